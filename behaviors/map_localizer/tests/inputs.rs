//! Bad input ends in a named state, slower or stopped.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod rig;

use nalgebra::{Matrix3, Vector3};
use rig::{Drive, Light, frame_header, setup, toml};
use yamabico_core::behavior::Behavior;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Goal, Kind, Odometry, PathHeader, Pose, PoseStatus, Reason};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, GOAL, MapLocalizer, ODOMETRY};

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
fn a_good_drive_keeps_its_pose() {
    let mut drive = Drive::new(Pose2::new(0.05, -0.05, 0.02), ROUTE);
    drive.run(6.0);
    let (place, heading) = drive.error();
    assert!(place < 0.06 && heading < 0.02, "{place} m, {heading} rad");
    assert_eq!(status(&drive).0, PoseStatus::Tracking);
    assert!(drive.robot.x > 1.5, "{:?}", drive.robot);
}

#[test]
fn a_successor_goes_on_from_where_its_predecessor_was() {
    let mut drive = Drive::new(Pose2::new(0.05, -0.05, 0.02), ROUTE);
    drive.run(6.0);
    let (mut memory, farthest) = (Vec::new(), drive.robot.x);
    drive.bench.behavior.remember(&mut memory);
    for (memory, knows) in [(memory.as_slice(), true), (b"[]".as_slice(), false)] {
        drive.bench = Bench::new(&toml(ROUTE), setup(256, 240)).unwrap();
        drive.bench.behavior.recall(memory);
        drive.run(0.1);
        let (place, heading) = drive.error();
        assert_eq!(place < 0.06 && heading < 0.02, knows, "{place} m, {heading} rad after {farthest} m");
    }
}

#[test]
fn pictures_without_lines_slow_the_robot_and_widen_the_pose() {
    for light in [Light::Dark, Light::Saturated, Light::Blurred] {
        let mut drive = Drive::new(Pose2::IDENTITY, ROUTE);
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
        assert!(drive.now_s() - evidence as f64 * 1e-9 > 2.5, "the pose tells how old its evidence is");
        drive.light = Light::Normal;
        drive.run(1.5);
        assert_eq!(status(&drive).0, PoseStatus::Tracking, "{light:?}");
    }
}

#[test]
fn a_kidnapped_robot_notices_and_is_found_or_says_that_it_is_lost() {
    let mut drive = Drive::new(Pose2::IDENTITY, ROUTE);
    drive.run(4.0);
    // Carried on by 0.8 m and to the side while the wheels stand.
    drive.robot = Pose2::new(drive.robot.x + 0.8, drive.robot.y + 0.2, drive.robot.theta + 0.1);
    let (mut was_honest, mut worst) = (false, 0.0_f64);
    for _ in 0..1500 {
        drive.step();
        was_honest |= status(&drive).0 != PoseStatus::Tracking;
        if status(&drive).0 == PoseStatus::Tracking && drive.now_s() > 24.0 {
            worst = worst.max(drive.error().0);
        }
    }
    assert!(was_honest, "it must not stay sure of itself");
    assert!(worst < 0.15, "{worst} m off and sure of it");
}

#[test]
fn odometry_that_jumps_moves_nothing() {
    let mut drive = Drive::new(Pose2::IDENTITY, ROUTE);
    drive.run(4.0);
    let before = drive.pose.unwrap();
    drive.wheels = Pose2::new(-40.0, 7.0, -1.0);
    drive.step();
    let after = drive.pose.unwrap();
    assert!((after.x - before.x).hypot(after.y - before.y) < 0.02);
    assert_eq!(status(&drive).0, PoseStatus::Inconsistent);
    assert!(after.covariance[0] > 0.005 && drive.proposal.twist.linear <= 0.2);
    drive.run(1.5);
    assert_eq!(status(&drive).0, PoseStatus::Tracking);
    assert!(drive.error().0 < 0.06);
}

#[test]
fn no_odometry_and_old_odometry_drive_nowhere() {
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
fn pictures_of_the_wrong_time_or_size_are_named() {
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
fn a_map_with_nothing_in_view_says_so() {
    let text = std::env::temp_dir().join(format!("yamabico-far-{}.toml", std::process::id()));
    std::fs::write(&text, "edge = [{ from_m = [900, 900, 0], to_m = [900, 900, 2] }]").unwrap();
    let mut drive = Drive::new(Pose2::IDENTITY, ROUTE);
    drive.bench =
        Bench::new(&format!("map = {:?}\n{ROUTE}", text.display().to_string()), setup(256, 240)).unwrap();
    drive.run(2.0);
    assert_eq!(status(&drive), (PoseStatus::Unknown, Reason::NoModel));
    assert!(drive.proposal.twist.linear <= 0.2);
    std::fs::remove_file(text).unwrap();
}

#[test]
fn maps_that_are_none_and_routes_through_walls_are_refused() {
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
    let mut drive = Drive::new(Pose2::IDENTITY, "route = [[5.0, 0.0]]");
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
    let off = (drive.robot.x - 1.5).hypot(drive.robot.y - 0.2);
    assert!(off < 0.15, "{off} m from the goal");
}

#[test]
fn a_fix_is_told_with_the_stamp_of_its_picture() {
    let mut drive = Drive::new(Pose2::IDENTITY, ROUTE);
    let mut evidence = Vec::new();
    for _ in 0..60 {
        drive.step();
        let (pose, _) = drive.bench.published::<Pose>("pose").pop().expect("a pose with every odometry");
        assert_eq!(pose.stamp_ns, drive.bench.published::<PathHeader>("path")[0].0.stamp_ns);
        evidence.push(pose.evidence_ns);
    }
    evidence.dedup();
    // Pictures are taken every 0.1 s.
    assert!(evidence.len() > 8 && evidence.iter().all(|stamp| stamp % 100_000_000 == 0), "{evidence:?}");
}
