//! Person in the hallway: a robot on the center line that stops for sonar echoes meets the person without contact.

use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::time::Time;
use yamabico_sim::body::{Body, BodyLimits, Urgency};
use yamabico_sim::random::stream;
use yamabico_sim::simulation::Simulation;
use yamabico_sim::sonar::{SonarConfig, measure_range};
use yamabico_sim::{Scene, World};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");
const GATE_M: f64 = 0.5;

/// Returns the number of halts, the minimum distance of a person (m), the time to the goal (s), and the numbers of contacts
/// and of strikes by a person.
fn drive(scene: &Scene, seed: u64, speed: f64, delay_s: f64) -> (u32, f64, f64, u32, u32) {
    let limits = BodyLimits {
        turn_slip: 0.0,
        speed: [0.6, 0.0, 1.2],
        acceleration: [0.5, 0.0, 2.0],
        emergency: [1.5, 0.0, 6.0],
        watchdog_s: 0.2,
    };
    let mut sim = Simulation::new(scene.clone(), Body::new(Pose2::IDENTITY, limits), 0.2, 1.0);
    let sonar = SonarConfig { max_m: 3.0, ..SonarConfig::default() };
    let mut rng = stream(seed, "sonar");
    let (mut halts, mut halted, mut clean, mut nearest) = (0, false, 0, f64::INFINITY);
    for tick in 0..6000 {
        let now = Time::from_secs_f64(f64::from(tick) * 0.02);
        sim.advance(now);
        let moment = sim.at(now);
        if moment.pose.x > 12.5 {
            return (halts, nearest, now.as_secs_f64(), moment.contacts, moment.struck);
        }
        nearest = nearest.min(sim.clearance(&moment).1);
        if tick % 3 == 0 {
            let people: Vec<_> = sim.people(now).collect();
            let echoes: Vec<_> = sonar
                .azimuths_deg
                .iter()
                .filter_map(|a| {
                    measure_range(&sonar, a.to_radians(), &sim.scene, &people, &moment.pose, &mut rng)
                })
                .collect();
            let close = echoes.iter().any(|r| *r < GATE_M);
            clean = if close { 0 } else { clean + 1 };
            halts += u32::from(close && !halted);
            halted = close || (halted && clean < 3);
        }
        let go = !halted && now.as_secs_f64() >= delay_s;
        let urgency = if halted { Urgency::Emergency } else { Urgency::Normal };
        sim.command(&Twist::new(if go { speed } else { 0.0 }, 0.0, 0.0), urgency, now);
    }
    panic!("seed {seed}, {speed} m/s: still not there");
}

#[test]
fn the_robot_halts_for_a_crossing_person_without_contact() {
    let mut world = World::from_toml(HALLWAY).unwrap();
    world.boxes.clear();
    for seed in 1..=20 {
        let scene = Scene::new(&world, seed).unwrap();
        let (speed, delay_s) = [(0.4, 0.0), (0.4, 1.0), (0.36, 0.3)][seed as usize % 3];
        let (halts, nearest, seconds, contacts, struck) = drive(&scene, seed, speed, delay_s);
        let summary = format!(
            "seed {seed} at {speed} m/s after {delay_s} s: {halts} halts, nearest {nearest:.2} m, {seconds:.1} s"
        );
        assert_eq!((contacts, struck), (0, 0), "{summary}");
        assert!(halts >= 1 && nearest > 0.2 && seconds < 60.0, "{summary}");
    }
}
