//! Invalid input results in a reported status and a slower or stopped robot.

use crate::rig::{Drive, drive, frame_header, pose_error, setup, toml};
use nalgebra::{Matrix3, Vector3};
use yamabico_core::behavior::Behavior;
use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_core::message::{Goal, Kind, Odometry, PathHeader, Pose, PoseStatus, Reason};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, GOAL, MapLocalizer, ODOMETRY};
use yamabico_rigs::camera_drive::Light;

const ROUTE: &str = "route = [[12.5, 0.0]]";

fn nees(drive: &Drive) -> f64 {
    let pose = drive.pose.unwrap();
    let truth = drive.robot;
    let error = Vector3::new(
        pose.x - truth.x,
        pose.y - truth.y,
        yamabico_core::geometry::angle_difference(pose.theta, truth.theta),
    );
    let covariance = Matrix3::from_row_slice(&pose.covariance);
    error.dot(&(covariance.try_inverse().unwrap() * error))
}

fn status(drive: &Drive) -> (PoseStatus, Reason) {
    drive.bench.behavior.status()
}

#[test]
fn a_normal_drive_keeps_its_pose() {
    let mut drive = drive(Pose2::new(0.05, -0.05, 0.02), ROUTE);
    drive.run(6.0);
    let (position, heading) = pose_error(&drive);
    assert!(position < 0.06 && heading < 0.02, "{position} m, {heading} rad");
    assert_eq!(status(&drive).0, PoseStatus::Tracking);
    assert!(drive.robot.x > 1.5, "{:?}", drive.robot);
}

#[test]
fn a_restarted_behavior_restores_its_pose() {
    let mut drive = drive(Pose2::new(0.05, -0.05, 0.02), ROUTE);
    drive.run(6.0);
    let (mut state, farthest) = (Vec::new(), drive.robot.x);
    drive.bench.behavior.save_state(&mut state);
    for (state, is_restored) in [(state.as_slice(), true), (b"[]".as_slice(), false)] {
        drive.bench = Bench::new(&toml(ROUTE), setup(256, 240)).unwrap();
        drive.bench.behavior.restore_state(state);
        drive.run(0.1);
        let (position, heading) = pose_error(&drive);
        let is_accurate = position < 0.06 && heading < 0.02;
        assert_eq!(is_accurate, is_restored, "{position} m, {heading} rad after {farthest} m");
    }
}

#[test]
fn images_without_lines_slow_the_robot_and_increase_the_covariance() {
    for light in [Light::Uniform(1), Light::Uniform(255), Light::Haze] {
        let mut drive = drive(Pose2::IDENTITY, ROUTE);
        drive.run(4.0);
        let sigma = drive.pose.unwrap().covariance[8];
        drive.light = light;
        drive.run(3.0);
        assert_eq!(status(&drive).0, PoseStatus::Coasting, "{light:?}");
        assert!(
            matches!(status(&drive).1, Reason::TooFewSegments | Reason::TooFewMatches | Reason::Gated),
            "{light:?}: {:?}",
            status(&drive)
        );
        assert!(drive.proposal.twist.linear <= 0.2 + 1e-9, "{light:?}: half the speed");
        assert!(drive.pose.unwrap().covariance[8] > sigma);
        assert!(nees(&drive) < 25.0);
        let evidence = drive.pose.unwrap().evidence_ns;
        assert!(drive.now_s() - evidence as f64 * 1e-9 > 2.5, "the pose states the age of its evidence");
        drive.light = Light::Normal;
        drive.run(1.5);
        assert_eq!(status(&drive).0, PoseStatus::Tracking, "{light:?}");
    }
}

#[test]
fn a_kidnapped_robot_is_detected_and_relocalized_or_reported_lost() {
    let mut drive = drive(Pose2::IDENTITY, ROUTE);
    drive.run(4.0);
    // Displaced by 0.8 m forward and to the side while the wheels stand still.
    drive.robot = Pose2::new(drive.robot.x + 0.8, drive.robot.y + 0.2, drive.robot.theta + 0.1);
    let (mut was_detected, mut worst) = (false, 0.0_f64);
    for _ in 0..1500 {
        drive.step();
        was_detected |= status(&drive).0 != PoseStatus::Tracking;
        if status(&drive).0 == PoseStatus::Tracking && drive.now_s() > 24.0 {
            worst = worst.max(pose_error(&drive).0);
        }
    }
    assert!(was_detected, "the status must not stay Tracking");
    assert!(worst < 0.15, "{worst} m off with status Tracking");
}

#[test]
fn a_jump_of_the_odometry_does_not_move_the_pose() {
    let mut drive = drive(Pose2::IDENTITY, ROUTE);
    drive.run(4.0);
    let before = drive.pose.unwrap();
    drive.wheels = Pose2::new(-40.0, 7.0, -1.0);
    drive.step();
    let after = drive.pose.unwrap();
    assert!((after.x - before.x).hypotenuse(after.y - before.y) < 0.02);
    assert_eq!(status(&drive).0, PoseStatus::Inconsistent);
    assert!(after.covariance[0] > 0.005 && drive.proposal.twist.linear <= 0.2);
    drive.run(1.5);
    assert_eq!(status(&drive).0, PoseStatus::Tracking);
    assert!(pose_error(&drive).0 < 0.06);
}

#[test]
fn missing_or_stale_odometry_does_not_drive() {
    let mut bench = Bench::<MapLocalizer>::new(&toml(ROUTE), setup(256, 240)).unwrap();
    let proposal = bench.at(1.0).propose();
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::NoInput)));
    let odometry = |seconds| Odometry { stamp_ns: Time::from_secs_f64(seconds).0, ..Odometry::default() };
    assert_eq!(bench.feed(&ODOMETRY, &odometry(1.0), &[]).propose().kind(), Some(Kind::Drive));
    let proposal = bench.at(1.5).propose();
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::StaleInput)));
    let broken = Odometry { x: f64::NAN, ..odometry(1.6) };
    bench.at(1.6).feed(&ODOMETRY, &broken, &[]).propose();
    assert_eq!(bench.behavior.status().1, Reason::MalformedInput);
}

#[test]
fn images_with_a_wrong_time_or_size_are_reported() {
    let mut bench = Bench::<MapLocalizer>::new(&toml(ROUTE), setup(256, 240)).unwrap();
    let odometry = |seconds| Odometry { stamp_ns: Time::from_secs_f64(seconds).0, ..Odometry::default() };
    for i in 0..20 {
        let seconds = 10.0 + 0.1 * f64::from(i);
        bench.at(seconds).feed(&ODOMETRY, &odometry(seconds), &[]).propose();
    }
    let black = vec![0; 256 * 240];
    let mut reason = |seconds: f64, width: u32| {
        bench.feed(&CAMERA, &frame_header(width, 240, seconds), &black).propose();
        bench.behavior.status().1
    };
    assert_eq!(reason(9.0, 256), Reason::TooOld);
    assert_eq!(reason(20.0, 256), Reason::MalformedInput);
    assert_eq!(reason(11.0, 128), Reason::MalformedInput);
    assert_eq!(reason(11.2, 256), Reason::TooFewSegments);
    assert_eq!(reason(11.1, 256), Reason::OutOfOrder);
}

#[test]
fn a_map_without_edges_in_view_is_reported() {
    let text = std::env::temp_dir().join(format!("yamabico-far-{}.toml", std::process::id()));
    std::fs::write(&text, "edge = [{ from_m = [900, 900, 0], to_m = [900, 900, 2] }]").unwrap();
    let mut drive = drive(Pose2::IDENTITY, ROUTE);
    drive.bench =
        Bench::new(&format!("map = {:?}\n{ROUTE}", text.display().to_string()), setup(256, 240)).unwrap();
    drive.run(2.0);
    assert_eq!(status(&drive), (PoseStatus::Unknown, Reason::NoModel));
    assert!(drive.proposal.twist.linear <= 0.2);
    std::fs::remove_file(text).unwrap();
}

#[test]
fn invalid_maps_and_routes_through_walls_are_rejected() {
    let refused = |toml: &str| Bench::<MapLocalizer>::new(toml, setup(256, 240)).err().unwrap();
    assert_eq!(refused("map = \"maps/none.toml\"").key, "map");
    assert_eq!(refused("map = \"worlds/hallway.toml\"").key, "map");
    let wall = refused(&toml("route = [[3.0, 0.0], [3.0, 3.0]]"));
    assert!(wall.key == "route" && wall.problem.contains("corner 2"), "{wall}");
    let millimeters = std::env::temp_dir().join(format!("yamabico-mm-{}.toml", std::process::id()));
    std::fs::write(&millimeters, "edge = [{ from_m = [0, 0, 0], to_m = [18000, 0, 0] }]").unwrap();
    let refusal = refused(&format!("map = {:?}", millimeters.display().to_string()));
    assert!(refusal.problem.contains("millimeters"), "{refusal}");
    std::fs::remove_file(millimeters).unwrap();
}

#[test]
fn a_goal_replaces_the_route_but_not_through_walls() {
    let mut drive = drive(Pose2::IDENTITY, "route = [[5.0, 0.0]]");
    drive.run(2.0);
    let goal = |x: f64, y: f64| Goal { x, y, theta: f64::NAN, tolerance_m: 0.1, ..Goal::default() };
    let end = |drive: &Drive| {
        let path = drive.bench.published::<PathHeader>("path").pop().unwrap();
        path.1.last().map(|point| (point.x, point.y)).unwrap()
    };
    drive.bench.feed(&GOAL, &goal(3.0, 3.0), &[]);
    drive.step();
    assert_eq!(end(&drive), (5.0, 0.0));
    assert!(drive.proposal.note.as_str().contains("refused"), "{}", drive.proposal.note.as_str());
    drive.bench.feed(&GOAL, &goal(f64::NAN, 0.0), &[]);
    drive.step();
    assert_eq!(end(&drive), (5.0, 0.0));
    drive.bench.feed(&GOAL, &goal(1.5, 0.2), &[]);
    drive.step();
    assert_eq!(end(&drive), (1.5, 0.2));
    drive.run(8.0);
    assert!(drive.proposal.note.as_str().contains("arrived"), "{}", drive.proposal.note.as_str());
    assert_eq!(drive.proposal.twist.linear, 0.0);
    let off = (drive.robot.x - 1.5).hypotenuse(drive.robot.y - 0.2);
    assert!(off < 0.15, "{off} m from the goal");
}

#[test]
fn a_fix_is_published_with_the_stamp_of_its_image() {
    let mut drive = drive(Pose2::IDENTITY, ROUTE);
    let mut evidence = Vec::new();
    for _ in 0..60 {
        drive.step();
        let (pose, _) = drive.bench.published::<Pose>("pose").pop().expect("a pose with every odometry");
        assert_eq!(pose.stamp_ns, drive.bench.published::<PathHeader>("path")[0].0.stamp_ns);
        evidence.push(pose.evidence_ns);
    }
    evidence.dedup();
    // The camera period is 0.1 s.
    assert!(evidence.len() > 8 && evidence.iter().all(|stamp| stamp % 100_000_000 == 0), "{evidence:?}");
}

#[test]
fn a_camera_that_dies_slows_the_robot_after_a_second() {
    let mut drive = drive(Pose2::IDENTITY, ROUTE);
    drive.run(4.0);
    let (died_s, pose) = (drive.now_s(), drive.wheels);
    let mut after = |seconds: f64| {
        let now_s = died_s + seconds;
        let stamp_ns = Time::from_secs_f64(now_s).0;
        let odometry = Odometry { stamp_ns, x: pose.x, y: pose.y, theta: pose.theta, ..Odometry::default() };
        let proposal = drive.bench.at(now_s).feed(&ODOMETRY, &odometry, &[]).propose();
        (drive.bench.behavior.status().0, drive.bench.behavior.status().1, proposal.twist.linear)
    };
    let (status, _, speed) = after(0.9);
    assert!(status == PoseStatus::Tracking && speed > 0.3, "{status:?}, {speed} m/s");
    // The image in transit was 0.14 s old at most.
    let (status, reason, speed) = after(1.2);
    assert_eq!((status, reason), (PoseStatus::Coasting, Reason::StaleInput));
    assert!(speed <= 0.2 + 1e-9, "{speed} m/s");
}
