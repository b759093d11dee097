//! Good and bad input: what the avoider sees, and named reasons where it cannot.

mod rig;

use rig::{TABLE, Told, camera, picture, setup, tick};
use yamabico_core::behavior::{Behavior, BuildError};
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

/// Ten pictures a second for a second, each the same; the last proposal.
fn drive(bench: &mut Avoider, told: &Told, pixels: Option<&[u8]>) -> Proposal {
    let mut proposal = Proposal::default();
    for i in 0..10 {
        let seconds = told.seconds + 0.1 * f64::from(i);
        proposal = tick(bench, &Told { seconds, ..told.clone() }, pixels);
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
    let told = Told::default();
    let proposal = drive(&mut avoider(), &told, Some(&picture(told.robot, None)));
    assert_eq!(answer(&proposal), (Some(Kind::Abstain), Some(Reason::Clear)), "{}", proposal.note.as_str());
}

#[test]
fn a_successor_knows_the_box_that_its_predecessor_saw() {
    let (mut bench, told) = (avoider(), Told::default());
    drive(&mut bench, &told, Some(&picture(told.robot, Some([4.6, 0.25]))));
    let mut memory = Vec::new();
    bench.behavior.remember(&mut memory);

    // Beside the box, which the camera has lost, and turned towards it.
    let beside = Told { seconds: 4.0, robot: Pose2::new(4.2, -0.4, 0.9), ..told };
    let empty = picture(beside.robot, None);
    let wary = |bench: &mut Avoider| {
        let proposal = tick(bench, &beside, Some(&empty));
        (bench.behavior.state(), bench.behavior.things().confirmed().count(), proposal.kind())
    };
    let (state, things) = (bench.behavior.state(), bench.behavior.things().confirmed().count());
    assert!(state == State::Avoid && things > 0, "{state:?}");
    let mut successor = avoider();
    successor.behavior.recall(&memory);
    let wariness = wary(&mut bench);
    assert_eq!(wary(&mut successor), wariness);
    assert!(wariness.1 > 0 && wariness.2 != Some(Kind::Abstain), "{wariness:?}");
    assert_eq!(wary(&mut avoider()).1, 0, "who knows nothing would leave the box to chance");
    for nonsense in ["", "null", "[1, 2]", "[{\"state\": \"Dance\"}, {}, 0]"] {
        let mut successor = avoider();
        successor.behavior.recall(nonsense.as_bytes());
        assert_eq!(successor.behavior.state(), State::Follow, "{nonsense}");
    }
}

#[test]
fn a_box_ahead_is_driven_around_on_its_wider_side() {
    for (y, side) in [(0.25, -1.0), (-0.25, 1.0)] {
        let (mut bench, told) = (avoider(), Told::default());
        let proposal = drive(&mut bench, &told, Some(&picture(told.robot, Some([4.6, y]))));
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
    let (mut bench, told) = (avoider(), Told::default());
    let box_at = Some([4.3, 0.15]);
    drive(&mut bench, &told, Some(&picture(told.robot, box_at)));
    let headings = [0.0, -8.0, -16.0, -24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 8.0];
    for (i, heading_deg) in headings.into_iter().enumerate() {
        let robot = Pose2::new(told.robot.x, told.robot.y, f64::to_radians(heading_deg));
        let turned = Told { seconds: 1.0 + i as f64, robot, ..told.clone() };
        let proposal = drive(&mut bench, &turned, Some(&picture(robot, box_at)));
        let note = proposal.note.as_str();
        assert_eq!(proposal.kind(), Some(Kind::Drive), "turned {heading_deg} degrees: {note}");
    }
}

#[test]
fn thresholds_of_another_camera_are_refused() {
    let other = Intrinsics::from_horizontal_fov(640, 480, 1.0);
    let refused = Avoider::new(TABLE, setup(other)).err();
    let Some(BuildError { key, problem }) = refused else { panic!("not refused") };
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
fn without_thresholds_near_it_creeps() {
    let told = Told::default();
    let pixels = picture(told.robot, None);
    let astray = Told { robot: Pose2::new(3.0, 0.0, 1.2), ..told.clone() };
    creeps(&drive(&mut avoider(), &astray, Some(&pixels)), Reason::NoThreshold);
    let mut without =
        Avoider::new("map = \"maps/hallway.toml\"", setup(camera().0)).expect("a configuration");
    creeps(&drive(&mut without, &told, Some(&pixels)), Reason::NoThreshold);
    let bright = Told { exposure: 2.0, ..told };
    creeps(&drive(&mut avoider(), &bright, Some(&pixels)), Reason::NoThreshold);
}

#[test]
fn dark_saturated_covered_and_blurred_pictures_show_nothing() {
    let told = Told::default();
    let clear = picture(told.robot, Some([4.6, 0.0]));
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
        creeps(&drive(&mut avoider(), &told, Some(&pixels)), Reason::LowContrast);
    }
}

#[test]
fn without_pictures_it_creeps() {
    creeps(&drive(&mut avoider(), &Told::default(), None), Reason::StaleInput);
}

#[test]
fn a_silent_sonar_and_an_echo_halt() {
    let told = Told::default();
    let pixels = picture(told.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &told, Some(&pixels));
    let echo = tick(&mut bench, &Told { seconds: 1.0, range_m: Some(0.3), ..told.clone() }, None);
    assert_eq!(echo.kind(), Some(Kind::Halt));
    let mut bench = avoider();
    drive(&mut bench, &told, Some(&pixels));
    let silent = bench.at(1.4).propose();
    assert_eq!(silent.kind(), Some(Kind::Halt), "{}", silent.note.as_str());
}

#[test]
fn without_a_pose_nothing_drives() {
    let mut bench = avoider();
    rig::hear(&mut bench, 0, None);
    let none = bench.at(0.02).propose();
    assert_eq!(answer(&none), (Some(Kind::Halt), Some(Reason::NoInput)));
    assert!(!none.axes.contains(Axis::Angular), "turning stays open for whoever looks around");
    let told = Told::default();
    let pixels = picture(told.robot, None);
    let lost = drive(&mut avoider(), &Told { status: PoseStatus::Lost, ..told.clone() }, Some(&pixels));
    assert_eq!(answer(&lost), (Some(Kind::Halt), Some(Reason::Lost)));
    let mut bench = avoider();
    drive(&mut bench, &told, Some(&pixels));
    rig::hear(&mut bench, 2_000_000_000, None);
    assert_eq!(answer(&bench.at(2.0).propose()), (Some(Kind::Halt), Some(Reason::StaleInput)));
}

#[test]
fn nonsense_and_time_backwards_move_nothing() {
    let told = Told::default();
    let pixels = picture(told.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &told, Some(&pixels));
    for (seconds, robot) in [
        (1.0, Pose2 { x: f64::NAN, ..told.robot }),
        (1.1, Pose2 { x: f64::INFINITY, y: f64::NAN, theta: f64::NAN }),
        (0.2, told.robot),
        (0.0, Pose2::new(9.0, 0.0, 0.0)),
    ] {
        let proposal = tick(&mut bench, &Told { seconds, robot, ..told.clone() }, Some(&pixels));
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
fn a_halt_is_followed_by_a_look_at_a_later_picture_only() {
    let told = Told::default();
    let pixels = picture(told.robot, None);
    let mut bench = avoider();
    drive(&mut bench, &told, Some(&pixels));
    let at = |seconds: f64, range_m: Option<f64>| Told { seconds, range_m, ..told.clone() };
    assert_eq!(tick(&mut bench, &at(1.0, Some(0.3)), None).note.as_str(), State::Halt.as_str());
    assert_eq!(tick(&mut bench, &at(1.1, None), None).note.as_str(), State::Relook.as_str());
    for i in 0..30 {
        tick(&mut bench, &at(1.2 + 0.05 * f64::from(i), None), None);
    }
    let looked = tick(&mut bench, &at(2.75, None), Some(&pixels));
    assert_eq!(answer(&looked), (Some(Kind::Abstain), Some(Reason::Clear)), "{}", looked.note.as_str());
}
