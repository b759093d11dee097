//! Valid and invalid input: proposals, published obstacles, and reasons of failures.

use crate::rig::{Situation, TABLE, camera, passages, render, setup, tick};
use yamabico_core::behavior::{Behavior, ParameterError};
use yamabico_core::camera::Intrinsics;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Axis, Kind, ObstaclesHeader, PoseStatus, Proposal, Reason};
use yamabico_core::testing::Bench;
use yamabico_stationary_obstacle_avoider::halt_state_machine::State;
use yamabico_stationary_obstacle_avoider::{ODOMETRY, POSE, StationaryObstacleAvoider};

type Avoider = Bench<StationaryObstacleAvoider>;

fn avoider() -> Avoider {
    Bench::new(TABLE, setup(camera().0)).expect("a valid configuration")
}

/// Feeds the same frame ten times in a second, and returns the last proposal.
fn drive(bench: &mut Avoider, situation: &Situation, pixels: Option<&[u8]>) -> Proposal {
    let mut proposal = Proposal::default();
    for i in 0..10 {
        let seconds = situation.seconds + 0.1 * f64::from(i);
        proposal = tick(bench, &Situation { seconds, ..situation.clone() }, pixels);
    }
    proposal
}

fn answer(proposal: &Proposal) -> (Option<Kind>, Option<Reason>) {
    (proposal.kind(), proposal.reason())
}

fn creeps(proposal: &Proposal, reason: Reason) {
    assert_eq!(answer(proposal), (Some(Kind::Limit), Some(reason)), "{}", proposal.note.as_str());
    assert!(proposal.axes == Axes::LINEAR && proposal.limits.get(Axis::Linear) <= 0.1, "{proposal:?}");
}

#[test]
fn a_clear_hallway_leaves_the_driving_to_others() {
    let situation = Situation::default();
    let proposal = drive(&mut avoider(), &situation, Some(&render(situation.robot, None)));
    assert_eq!(answer(&proposal), (Some(Kind::Abstain), Some(Reason::Clear)), "{}", proposal.note.as_str());
}

#[test]
fn a_restarted_behavior_remembers_the_box() {
    let (mut bench, situation) = (avoider(), Situation::default());
    drive(&mut bench, &situation, Some(&render(situation.robot, Some([4.6, 0.25]))));
    let mut memory = Vec::new();
    bench.behavior.save_state(&mut memory);

    // Beside the box, which is out of view, and turned toward it.
    let beside = Situation { seconds: 4.0, robot: Pose2::new(4.2, -0.4, 0.9), ..situation };
    let empty = render(beside.robot, None);
    let wary = |bench: &mut Avoider| {
        let proposal = tick(bench, &beside, Some(&empty));
        (passages(bench).state(), passages(bench).known_obstacles().confirmed().count(), proposal.kind())
    };
    let (state, obstacles) =
        (passages(&bench).state(), passages(&bench).known_obstacles().confirmed().count());
    assert!(state == State::Avoid && obstacles > 0, "{state:?}");
    let mut successor = avoider();
    successor.behavior.restore_state(&memory);
    let wariness = wary(&mut bench);
    assert_eq!(wary(&mut successor), wariness);
    assert!(wariness.1 > 0 && wariness.2 != Some(Kind::Abstain), "{wariness:?}");
    assert_eq!(wary(&mut avoider()).1, 0, "without saved state the box must be unknown");
    for nonsense in ["", "null", "[1, 2]", "[{\"state\": \"Dance\"}, {}, 0]"] {
        let mut successor = avoider();
        successor.behavior.restore_state(nonsense.as_bytes());
        assert_eq!(passages(&successor).state(), State::Follow, "{nonsense}");
    }
}

#[test]
fn a_box_ahead_is_driven_around_on_its_wider_side() {
    for (y, side) in [(0.25, -1.0), (-0.25, 1.0)] {
        let (mut bench, situation) = (avoider(), Situation::default());
        let proposal = drive(&mut bench, &situation, Some(&render(situation.robot, Some([4.6, y]))));
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{}", proposal.note.as_str());
        assert!(proposal.twist.angular * side > 0.05, "box at {y}: {:?}", proposal.twist);
        let published = bench.published::<ObstaclesHeader>("obstacles");
        let (_, obstacles) = published.last().expect("obstacles");
        let nearest =
            obstacles.iter().min_by(|a, b| (a.y - y).abs().total_cmp(&(b.y - y).abs())).expect("the box");
        assert!((nearest.x - 1.6).abs() < 0.4 && (nearest.y - y).abs() < 0.3, "{nearest:?}");
    }
}

#[test]
fn a_passage_stays_one_while_the_robot_turns() {
    let (mut bench, situation) = (avoider(), Situation::default());
    let box_at = Some([4.3, 0.15]);
    drive(&mut bench, &situation, Some(&render(situation.robot, box_at)));
    let headings = [0.0, -8.0, -16.0, -24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 8.0];
    for (i, heading_deg) in headings.into_iter().enumerate() {
        let robot = Pose2::new(situation.robot.x, situation.robot.y, f64::to_radians(heading_deg));
        let turned = Situation { seconds: 1.0 + i as f64, robot, ..situation.clone() };
        let proposal = drive(&mut bench, &turned, Some(&render(robot, box_at)));
        let note = proposal.note.as_str();
        assert_eq!(proposal.kind(), Some(Kind::Drive), "turned {heading_deg} degrees: {note}");
    }
}

#[test]
fn required_thresholds_of_another_camera_are_refused() {
    let other = Intrinsics::from_horizontal_fov(640, 480, 1.0);
    assert!(Avoider::new(TABLE, setup(other)).is_ok(), "left out where they are not required");
    let refused = Avoider::new(&format!("{TABLE}\nrequires_thresholds = true"), setup(other)).err();
    let Some(ParameterError { key, problem, .. }) = refused else { panic!("not refused") };
    assert_eq!(key, "thresholds");
    assert!(problem.contains("256 x 240") && problem.contains("640 x 480"), "{problem}");
}

#[test]
fn a_robot_wider_than_the_view_is_refused() {
    let mut wide = setup(camera().0);
    wide.robot.radius_m = 0.6;
    assert_eq!(Avoider::new(TABLE, wide).err().map(|error| error.key), Some("inputs.camera".into()));
}

#[test]
fn without_required_thresholds_near_it_creeps() {
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    let requiring = |table: &str| {
        Avoider::new(&format!("{table}\nrequires_thresholds = true"), setup(camera().0))
            .expect("a configuration")
    };
    let astray = Situation { robot: Pose2::new(3.0, 0.0, 1.2), ..situation.clone() };
    creeps(&drive(&mut requiring(TABLE), &astray, Some(&pixels)), Reason::NoThreshold);
    let without = "method = \"passages\"\nmap = \"maps/hallway.toml\"";
    creeps(&drive(&mut requiring(without), &situation, Some(&pixels)), Reason::NoThreshold);
    let bright = Situation { exposure: 2.0, ..situation };
    for turned in [&astray, &bright] {
        creeps(&drive(&mut avoider(), turned, Some(&pixels)), Reason::NoThreshold);
    }
}

#[test]
fn without_thresholds_edges_on_the_floor_show_obstacles() {
    let mut bench = Avoider::new("method = \"passages\"\nmap = \"maps/hallway.toml\"", setup(camera().0))
        .expect("a configuration");
    for (x, y, theta) in [(3.0, 0.0, 0.0), (4.0, 0.2, 0.1), (7.0, -0.2, -0.1)] {
        let situation = Situation { seconds: x, robot: Pose2::new(x, y, theta), ..Situation::default() };
        let proposal = drive(&mut bench, &situation, Some(&render(situation.robot, None)));
        assert_eq!(
            answer(&proposal),
            (Some(Kind::Abstain), Some(Reason::Clear)),
            "{}",
            proposal.note.as_str()
        );
    }
    let situation = Situation { seconds: 9.0, ..Situation::default() };
    let proposal = drive(&mut bench, &situation, Some(&render(situation.robot, Some([4.6, 0.25]))));
    assert_eq!(proposal.kind(), Some(Kind::Drive), "{}", proposal.note.as_str());
    assert!(proposal.twist.angular < -0.05, "{:?}", proposal.twist);
}

#[test]
fn dark_saturated_covered_and_blurred_frames_are_refused() {
    let situation = Situation::default();
    let clear = render(situation.robot, Some([4.6, 0.0]));
    let dark: Vec<u8> = clear.iter().map(|&p| p / 40).collect();
    let saturated = vec![255; clear.len()];
    let covered = vec![17; clear.len()];
    let blurred: Vec<u8> = clear
        .chunks(256)
        .flat_map(|row| {
            (0..256_usize).map(|u| {
                let near = &row[u.saturating_sub(30)..(u + 31).min(256)];
                (near.iter().map(|&p| u32::from(p)).sum::<u32>() / near.len() as u32) as u8
            })
        })
        .collect();
    for pixels in [dark, saturated, covered, blurred] {
        creeps(&drive(&mut avoider(), &situation, Some(&pixels)), Reason::LowContrast);
    }
}

#[test]
fn without_frames_it_creeps() {
    creeps(&drive(&mut avoider(), &Situation::default(), None), Reason::StaleInput);
}

#[test]
fn a_silent_sonar_and_an_echo_halt() {
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &situation, Some(&pixels));
    let echo = tick(&mut bench, &Situation { seconds: 1.0, range_m: Some(0.3), ..situation.clone() }, None);
    assert_eq!(echo.kind(), Some(Kind::Halt));
    let mut bench = avoider();
    drive(&mut bench, &situation, Some(&pixels));
    let silent = bench.at(1.4).propose();
    assert_eq!(silent.kind(), Some(Kind::Halt), "{}", silent.note.as_str());
}

#[test]
fn without_a_pose_nothing_drives() {
    let mut bench = avoider();
    crate::rig::feed_sonar(&mut bench, 0, None);
    let none = bench.at(0.02).propose();
    assert_eq!(answer(&none), (Some(Kind::Halt), Some(Reason::NoInput)));
    assert!(!none.axes.contains(Axis::Angular), "turning must remain available to other behaviors");
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    let lost =
        drive(&mut avoider(), &Situation { status: PoseStatus::Lost, ..situation.clone() }, Some(&pixels));
    assert_eq!(answer(&lost), (Some(Kind::Halt), Some(Reason::Lost)));
    let mut bench = avoider();
    drive(&mut bench, &situation, Some(&pixels));
    crate::rig::feed_sonar(&mut bench, 2_000_000_000, None);
    assert_eq!(answer(&bench.at(2.0).propose()), (Some(Kind::Halt), Some(Reason::StaleInput)));
}

#[test]
fn non_finite_values_and_time_jumps_do_not_move_the_robot() {
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &situation, Some(&pixels));
    for (seconds, robot) in [
        (1.0, Pose2 { x: f64::NAN, ..situation.robot }),
        (1.1, Pose2 { x: f64::INFINITY, y: f64::NAN, theta: f64::NAN }),
        (0.2, situation.robot),
        (0.0, Pose2::new(9.0, 0.0, 0.0)),
    ] {
        let proposal = tick(&mut bench, &Situation { seconds, robot, ..situation.clone() }, Some(&pixels));
        assert_ne!(proposal.kind(), Some(Kind::Drive), "{seconds} {robot:?}");
        assert!(proposal.twist.is_finite());
    }
    let odometry = yamabico_core::message::Odometry { stamp_ns: u64::MAX, ..Default::default() };
    let pose =
        yamabico_core::message::Pose { stamp_ns: u64::MAX, evidence_ns: u64::MAX, ..Default::default() };
    bench.at(1.2).feed(&ODOMETRY, &odometry, &[]);
    bench.feed(&POSE, &pose, &[]);
    assert_ne!(bench.propose().kind(), Some(Kind::Drive));
}

#[test]
fn only_a_frame_captured_after_the_halt_releases_it() {
    let situation = Situation::default();
    let pixels = render(situation.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &situation, Some(&pixels));
    let at = |seconds: f64, range_m: Option<f64>| Situation { seconds, range_m, ..situation.clone() };
    assert_eq!(tick(&mut bench, &at(1.0, Some(0.3)), None).note.as_str(), State::Halt.as_str());
    assert_eq!(tick(&mut bench, &at(1.1, None), None).note.as_str(), State::Relook.as_str());
    for i in 0..30 {
        tick(&mut bench, &at(1.2 + 0.05 * f64::from(i), None), None);
    }
    let looked = tick(&mut bench, &at(2.75, None), Some(&pixels));
    assert_eq!(answer(&looked), (Some(Kind::Abstain), Some(Reason::Clear)), "{}", looked.note.as_str());
}
