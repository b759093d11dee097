//! Driving in a corridor without a map: the frame of the corridor takes the place of map, pose and path.

use crate::rig::{Situation, beam, camera, feed_beams, passages, render, setup};
use yamabico_core::behavior::Setup;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Axes, Axis, Corridor, FrameHeader, Kind, Odometry, Proposal, Reason};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_stationary_obstacle_avoider::halt_state_machine::State;
use yamabico_stationary_obstacle_avoider::{CAMERA, CORRIDOR, ODOMETRY, StationaryObstacleAvoider};

type Avoider = Bench<StationaryObstacleAvoider>;

fn avoider() -> Avoider {
    Bench::new("method = \"passages\"", setup(camera().0)).expect("a valid configuration")
}

/// Half the width of the rendered hallway, m.
const HALF_WIDTH_M: f64 = 1.0;

/// Feeds all inputs of a robot that sees the corridor with this probability; returns the proposal.
fn tick(bench: &mut Avoider, situation: &Situation, pixels: &[u8], probability: f64) -> Proposal {
    let Situation { seconds, robot, range_m, .. } = *situation;
    let stamp_ns = Time::from_secs_f64(seconds).0;
    // The odometry has an origin and a direction of its own.
    let odometry = Pose2::new(-7.0, 2.0, 0.8).compose(&robot);
    bench.at(seconds).feed(&ODOMETRY, &Odometry::new(stamp_ns, &odometry, &Twist::ZERO), &[]);
    bench.feed(&CAMERA, &FrameHeader::gray(256, 240, stamp_ns), pixels);
    feed_beams(bench, seconds, &[0.35, 0.0, -0.35].map(|azimuth_rad| beam(azimuth_rad, range_m)));
    let corridor = Corridor {
        stamp_ns,
        evidence_ns: stamp_ns,
        heading_rad: robot.theta,
        heading_sigma_rad: 0.01,
        left_m: HALF_WIDTH_M - robot.y,
        left_sigma_m: 0.05,
        right_m: HALF_WIDTH_M + robot.y,
        right_sigma_m: 0.05,
        probability,
        ..Corridor::default()
    };
    bench.feed(&CORRIDOR, &corridor, &[]);
    bench.propose()
}

/// Stands for a second; returns the last proposal.
fn stand(bench: &mut Avoider, robot: Pose2, from_s: f64, obstacle: Option<[f64; 2]>) -> Proposal {
    let pixels = render(robot, obstacle);
    let at = |i: u32| Situation { seconds: from_s + 0.1 * f64::from(i), robot, ..Situation::default() };
    (0..10).map(|i| tick(bench, &at(i), &pixels, 0.95)).last().expect("a proposal")
}

#[test]
fn an_empty_corridor_leaves_the_driving_to_others() {
    let mut bench = avoider();
    for (i, (x, y, theta)) in
        [(3.0, 0.0, 0.0), (3.4, 0.15, 0.1), (3.8, -0.2, -0.12), (5.0, 0.0, 0.0)].into_iter().enumerate()
    {
        let proposal = stand(&mut bench, Pose2::new(x, y, theta), i as f64, None);
        let note = proposal.note.as_str();
        assert_eq!(
            (proposal.kind(), proposal.reason()),
            (Some(Kind::Abstain), Some(Reason::Clear)),
            "{note}"
        );
    }
}

#[test]
fn a_box_ahead_is_driven_around_on_its_wider_side() {
    for (y, side) in [(0.25, -1.0), (-0.25, 1.0)] {
        let mut bench = avoider();
        let proposal = stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 0.0, Some([4.6, y]));
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{}", proposal.note.as_str());
        assert!(proposal.twist.angular * side > 0.05, "box at {y}: {:?}", proposal.twist);
        // Beside the box, out of view: remembered in the frame of the corridor.
        let beside = stand(&mut bench, Pose2::new(4.4, 0.45 * side, 0.0), 1.0, None);
        assert_eq!(passages(&bench).state(), State::Avoid, "{}", beside.note.as_str());
        let passed = stand(&mut bench, Pose2::new(5.6, 0.3 * side, 0.0), 2.0, None);
        assert_eq!(passed.kind(), Some(Kind::Abstain), "{}", passed.note.as_str());
    }
}

#[test]
fn no_corridor_in_view_limits_the_speed_and_does_not_halt() {
    let mut bench = avoider();
    let (situation, pixels) = (Situation::default(), render(Situation::default().robot, None));
    let mut proposal = Proposal::default();
    for i in 0..10 {
        let now = Situation { seconds: 0.1 * f64::from(i), ..situation.clone() };
        proposal = tick(&mut bench, &now, &pixels, 0.2);
    }
    assert_eq!(proposal.kind(), Some(Kind::Limit), "{}", proposal.note.as_str());
    assert!(proposal.axes == Axes::LINEAR && proposal.limits.get(Axis::Linear) <= 0.1);
    // A corridor that goes out of view is followed by odometry, slowly.
    stand(&mut bench, situation.robot, 1.0, None);
    for i in 0..20 {
        let now = Situation { seconds: 2.0 + 0.1 * f64::from(i), ..situation.clone() };
        proposal = tick(&mut bench, &now, &pixels, 0.2);
    }
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Limit), Some(Reason::Lost)));
}

#[test]
fn either_a_map_with_its_inputs_or_a_corridor_is_required() {
    let refused = |table: &str, connected: &[&str]| {
        let slots = ["camera", "odometry", "sonar"].iter().chain(connected).map(|&name| name.to_owned());
        let setup = Setup { connected: Some(slots.collect()), ..setup(camera().0) };
        Avoider::new(table, setup).err().map(|error| (error.key, error.remedy.unwrap_or_default()))
    };
    let map = "method = \"passages\"\nmap = \"maps/hallway.toml\"";
    assert_eq!(refused(map, &["pose", "path"]), None);
    assert_eq!(refused("", &["corridor"]), None);
    let with_thresholds = "thresholds = \"maps/hallway-thresholds.toml\"";
    for (table, connected, key, remedy) in [
        ("", &[][..], "map", "wall-follower.corridor"),
        (map, &["path"], "inputs.pose", "map-localizer.pose"),
        (map, &["pose"], "inputs.path", "map-localizer.path"),
        (map, &["pose", "path", "corridor"], "inputs.corridor", "remove"),
        ("", &["corridor", "pose"], "inputs.pose", "name the map"),
        (with_thresholds, &["corridor"], "thresholds", "name the map"),
    ] {
        let (found, proposed) = refused(table, connected).expect("refused");
        assert!(found == key && proposed.contains(remedy), "{found}: {proposed}");
    }
}
