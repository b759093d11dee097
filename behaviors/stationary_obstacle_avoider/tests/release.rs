//! Release of a halt where frames cannot be evaluated, echoes beside the path, and the end of a detour.

use crate::rig::{Situation, TABLE, beam, camera, feed_beams, passages, render, setup, tick};
use yamabico_core::message::{Kind, Proposal, Reason};
use yamabico_core::testing::Bench;
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::halt_state_machine::{Machine, Rules, State, Tick, VisionResult};

type Avoider = Bench<StationaryObstacleAvoider>;

fn avoider(table: &str) -> Avoider {
    Bench::new(table, setup(camera().0)).expect("a valid configuration")
}

/// Feeds the inputs every 50 ms from `from_s` for `seconds`; returns the last proposal.
fn stand(
    bench: &mut Avoider,
    (from_s, seconds): (f64, f64),
    situation: &Situation,
    pixels: Option<&[u8]>,
) -> Proposal {
    let mut proposal = Proposal::default();
    for i in 0..=(seconds / 0.05) as u32 {
        let now = Situation { seconds: from_s + 0.05 * f64::from(i), ..situation.clone() };
        proposal = tick(bench, &now, pixels.filter(|_| i % 2 == 0));
    }
    proposal
}

#[test]
fn a_halted_robot_without_thresholds_creeps_on_once_the_sonar_is_clean() {
    let pixels = render(Situation::default().robot, None);
    let (clear, near) = (Situation::default(), Situation { range_m: Some(0.3), ..Situation::default() });
    let frames: [Option<&[u8]>; 2] = [Some(&pixels), None];
    for (frames, reason) in frames.into_iter().zip([Reason::NoThreshold, Reason::StaleInput]) {
        let mut bench =
            avoider("method = \"passages\"\nmap = \"maps/hallway.toml\"\nrequires_thresholds = true");
        stand(&mut bench, (0.0, 2.0), &clear, frames);
        let halt = stand(&mut bench, (2.1, 0.0), &near, frames);
        assert_eq!((halt.kind(), halt.reason()), (Some(Kind::Halt), Some(Reason::Echo)));
        let standing = stand(&mut bench, (2.2, 8.0), &near, frames);
        assert_eq!(standing.kind(), Some(Kind::Halt), "an echo keeps the robot standing: {standing:?}");
        let creeping = stand(&mut bench, (10.3, 20.0), &clear, frames);
        assert_eq!(passages(&bench).state(), State::Follow, "{}", creeping.note.as_str());
        assert_eq!((creeping.kind(), creeping.reason()), (Some(Kind::Limit), Some(reason)));
    }
}

#[test]
fn a_remembered_box_ahead_is_not_driven_at_where_frames_tell_nothing() {
    let mut bench = avoider(TABLE);
    let ahead = Situation::default();
    let with_box = render(ahead.robot, Some([4.2, 0.0]));
    stand(&mut bench, (0.0, 1.0), &ahead, Some(&with_box));
    assert!(passages(&bench).known_obstacles().confirmed().count() > 0);
    stand(&mut bench, (1.1, 0.0), &Situation { range_m: Some(0.3), ..ahead.clone() }, None);
    let dark = vec![17; with_box.len()];
    let proposal = stand(&mut bench, (1.2, 12.0), &ahead, Some(&dark));
    assert!(!matches!(passages(&bench).state(), State::Follow | State::Rejoin), "{}", proposal.note.as_str());
}

#[test]
fn an_echo_beside_the_path_halts_nothing() {
    let mut bench = avoider(TABLE);
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    stand(&mut bench, (0.0, 1.0), &situation, Some(&pixels));
    for (seconds, azimuth_deg, halts) in [(1.1, 50.0, false), (1.2, -50.0, false), (1.3, 0.0, true)] {
        feed_beams(&mut bench, seconds, &[beam(0.0, None), beam(f64::to_radians(azimuth_deg), Some(0.4))]);
        let proposal = bench.at(seconds).propose();
        assert_eq!(proposal.kind() == Some(Kind::Halt), halts, "{azimuth_deg}: {}", proposal.note.as_str());
    }
}

fn driving(now_s: f64, progress_m: f64) -> Tick {
    Tick {
        now_s,
        echo: false,
        beside: false,
        speed_mps: 0.2,
        heading: 0.0,
        lateral_m: 0.3,
        path_heading_error: 0.0,
        progress_m,
        pose_ok: true,
        vision: None,
    }
}

fn look(now_s: f64, bearing: Option<f64>) -> Option<VisionResult> {
    Some(VisionResult { image_s: now_s, valid: true, clear: false, bearing })
}

#[test]
fn a_detour_ends_only_once_the_obstacle_is_passed() {
    let rules = Rules { passing_m: 0.5, ..Rules::default() };
    let (mut machine, mut order) = Machine::new(&rules)
        .step(&Tick { vision: look(0.0, Some(0.2)), heading: -0.2, ..driving(0.0, 0.0) }, &rules);
    assert_eq!(order.state, State::Avoid);
    for i in 1..=40 {
        let progress_m = 0.05 * f64::from(i);
        let beside = progress_m < 1.5;
        (machine, order) = machine.step(&Tick { beside, ..driving(f64::from(i), progress_m) }, &rules);
        let expected = if beside { State::Avoid } else { State::Rejoin };
        assert_eq!(order.state, expected, "after {progress_m} m");
    }
}

#[test]
fn only_frames_that_tell_nothing_release() {
    let rules = Rules::default();
    let standing = |now_s: f64| Tick { speed_mps: 0.0, ..driving(now_s, 0.0) };
    // Relook after a halt, then frames every 0.1 s of which only the first may be valid.
    let end = |first_valid: bool, clear: bool, echo: bool| {
        let (halted, _) = Machine::new(&rules).step(&Tick { echo: true, ..standing(0.0) }, &rules);
        let (mut machine, mut order) = halted.step(&Tick { echo, ..standing(0.1) }, &rules);
        for i in 0..40 {
            let now_s = 0.2 + 0.1 * f64::from(i);
            let valid = first_valid && i == 0;
            let vision = Some(VisionResult { image_s: now_s, valid, clear, bearing: None });
            (machine, order) = machine.step(&Tick { vision, echo, ..standing(now_s) }, &rules);
        }
        order.state
    };
    assert_eq!(end(false, true, false), State::Rejoin);
    assert_eq!(end(false, false, false), State::Relook);
    assert_eq!(end(false, true, true), State::Relook);
    assert_eq!(end(true, true, false), State::Relook, "a frame that could be evaluated showed no passage");
}
