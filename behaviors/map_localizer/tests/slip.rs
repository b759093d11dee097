//! Wheels that slip: the pose is right again within a second, standing or slow.

use crate::rig::{Drive, drive, pose_error};
use yamabico_core::geometry::{Hypotenuse, Pose2, Twist, angle_difference};
use yamabico_core::message::PoseStatus;

/// Time in which the pose must be right again, s.
const RECOVERY_S: f64 = 1.0;

/// Displaces the robot, unseen by its encoders, by this distance to the left (m) and angle (degrees).
fn displace(drive: &mut Drive, left_m: f64, turn_deg: f64) {
    let Pose2 { x, y, theta } = drive.robot;
    let turned = Pose2::new(x - left_m * theta.sin(), y + left_m * theta.cos(), theta);
    drive.robot = Pose2 { theta: theta + turn_deg.to_radians(), ..turned };
}

/// Asserts that the pose is right and known to be so.
fn assert_right(drive: &Drive, what: &str) {
    let (position, heading) = pose_error(drive);
    let (status, reason) = drive.bench.behavior.status();
    assert!(
        position < 0.06 && heading < 1.0_f64.to_radians(),
        "{what}: {position} m, {} deg, {status:?} {reason:?}",
        heading.to_degrees()
    );
    assert_eq!(status, PoseStatus::Tracking, "{what}: {reason:?}");
}

#[test]
fn a_standing_robot_recovers_from_ten_degrees_within_a_second() {
    for (left_m, turn_deg) in [(0.0, 10.0), (0.0, -10.0), (0.0, 5.0), (0.25, 8.0), (-0.25, -8.0), (0.3, 0.0)]
    {
        let mut drive = drive(Pose2::new(2.0, 0.0, 0.0), "start = { x_m = 2.0 }");
        drive.run(2.0);
        assert_right(&drive, "before");
        displace(&mut drive, left_m, turn_deg);
        drive.run(RECOVERY_S);
        assert_right(&drive, &format!("{left_m} m, {turn_deg} deg"));
        drive.run(1.0);
        assert_right(&drive, &format!("{left_m} m, {turn_deg} deg, later"));
    }
}

#[test]
fn a_driving_robot_recovers_from_ten_degrees_within_a_second() {
    for turn_deg in [10.0, -10.0] {
        let mut drive =
            drive(Pose2::new(2.0, 0.0, 0.0), "start = { x_m = 2.0 }\nroute = [[12.5, 0.0]]\nspeed_mps = 0.2");
        drive.run(3.0);
        displace(&mut drive, 0.0, turn_deg);
        drive.run(RECOVERY_S);
        assert_right(&drive, &format!("{turn_deg} deg"));
    }
}

#[test]
fn wheels_that_lag_behind_the_body_do_not_lose_the_pose() {
    let mut drive = drive(Pose2::new(2.0, 0.0, 0.0), "start = { x_m = 2.0 }");
    drive.run(1.0);
    let mut reported = drive.robot;
    let mut worst = 0.0_f64;
    for tick in 0..500 {
        // Turns to and fro in place, with stops in between.
        let turn = [0.0, 0.6, 0.0, -0.6][tick / 60 % 4];
        drive.fallback = Twist::planar(0.0, turn);
        let before = drive.robot;
        drive.step();
        // The reported heading is the true one, 0.14 s ago, by a first-order lag.
        let share = 0.02 / 0.14;
        let lag = angle_difference(drive.robot.theta, reported.theta);
        reported.theta += share * lag;
        let moved = before.relative(&drive.robot);
        drive.wheels = Pose2 { theta: 2.0 + reported.theta, ..drive.wheels };
        assert!(moved.x.hypotenuse(moved.y) < 0.01);
        if drive.bench.behavior.status().0 == PoseStatus::Tracking {
            worst = worst.max(pose_error(&drive).1.to_degrees());
        }
    }
    drive.fallback = Twist::ZERO;
    drive.run(RECOVERY_S);
    assert_right(&drive, "after");
    assert!(worst < 5.0, "{worst} deg off with status Tracking");
}
