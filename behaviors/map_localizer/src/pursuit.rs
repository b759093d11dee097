//! Steering along a path: pure pursuit.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, Twist, angle_difference};

use crate::route::{Route, Station};

/// A path that leads farther aside than this (rad) is first turned to where the robot stands.
const TURN_FIRST_RAD: f64 = 1.05;
/// Having begun to turn in place, the robot goes on until it is this near (rad).
const TURNED_RAD: f64 = 0.26;
/// Turn rate per radian of heading error while turning in place, 1/s.
const TURN_GAIN: f64 = 1.5;
/// Deceleration towards the goal, m/s^2.
const BRAKING_MPS2: f64 = 0.3;
/// Slowest approach to the goal, m/s.
const CREEP_MPS: f64 = 0.06;

/// The law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pursuit {
    /// Cruising speed, m/s.
    pub speed_mps: f64,
    /// Distance of the point that is steered for, meters.
    pub look_ahead_m: f64,
    /// Largest turn rate, rad/s.
    pub largest_turn_radps: f64,
}

impl Pursuit {
    /// The twist from a pose along the path, with a share (0 to 1) of the cruising speed. `is_turning` is whether the robot was
    /// turning in place before; it tells the same of the new twist. `aside_m` is added to how far left of the path the robot
    /// counts as standing.
    #[must_use]
    pub fn steer(
        &self,
        route: &Route,
        station: &Station,
        pose: &Pose2,
        aside_m: f64,
        share: f64,
        is_turning: &mut bool,
    ) -> Twist {
        let (sin, cos) = station.heading_rad.sin_cos();
        let pose = Pose2 { x: pose.x - sin * aside_m, y: pose.y + cos * aside_m, ..*pose };
        let ahead_m = self.look_ahead_m.min(station.to_go_m.max(0.3));
        let Some(mut target) = route.place_at(station.progress_m + ahead_m) else { return Twist::ZERO };
        if station.to_go_m < ahead_m {
            // The path's last piece goes on beyond its end, so that the aim does not swing round near it.
            target += nalgebra::Vector2::new(cos, sin) * (ahead_m - station.to_go_m);
        }
        let in_robot = point_in_robot(&pose, target);
        let bearing = in_robot.y.atan2(in_robot.x);
        *is_turning = bearing.abs() > if *is_turning { TURNED_RAD } else { TURN_FIRST_RAD };
        if *is_turning {
            let rate = (TURN_GAIN * bearing).clamp(-self.largest_turn_radps, self.largest_turn_radps);
            return Twist::planar(0.0, rate);
        }
        let braking = (2.0 * BRAKING_MPS2 * station.to_go_m.max(0.0)).sqrt().max(CREEP_MPS);
        let speed = (share * self.speed_mps).min(braking) * bearing.cos().max(0.2);
        let curvature = 2.0 * in_robot.y / in_robot.coords.norm_squared().max(0.01);
        let turn = speed * curvature;
        if turn.abs() > self.largest_turn_radps {
            // The same curve, more slowly.
            let slower = self.largest_turn_radps / turn.abs();
            return Twist::planar(speed * slower, turn * slower);
        }
        Twist::planar(speed, turn)
    }
}

/// A turn in place towards a heading (rad).
#[must_use]
pub fn turn_towards(heading: f64, target: f64, largest_radps: f64) -> Twist {
    let rate = TURN_GAIN * angle_difference(target, heading);
    Twist::planar(0.0, rate.clamp(-largest_radps, largest_radps))
}

fn point_in_robot(pose: &Pose2, point: Point2<f64>) -> Point2<f64> {
    pose.inverse().transform_point(point)
}

/// How far left of the path the robot counts as standing, less than it stands: a correction of the pose moves it at once, and
/// the steering follows at a steady rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JumpFilter {
    pending_m: f64,
}

/// How fast the steering takes a jump of the pose over, m/s.
const TAKE_OVER_MPS: f64 = 0.2;

impl JumpFilter {
    /// Takes a jump: by how much the robot has come to stand farther left of the path, meters.
    pub fn jump(&mut self, by_m: f64) {
        if by_m.is_finite() {
            self.pending_m += by_m;
        }
    }

    /// Takes over what it may in this time, s.
    pub fn pass(&mut self, elapsed_s: f64) {
        let step = TAKE_OVER_MPS * elapsed_s.clamp(0.0, 10.0);
        self.pending_m -= self.pending_m.clamp(-step, step);
    }

    /// To be added to how far left of the path the robot stands, meters.
    #[must_use]
    pub fn aside_m(&self) -> f64 {
        -self.pending_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: Pursuit = Pursuit { speed_mps: 0.4, look_ahead_m: 0.8, largest_turn_radps: 0.8 };

    fn drive(mut pose: Pose2, seconds: f64) -> (Pose2, f64) {
        let route = Route::new(vec![Point2::new(0.0, 0.0), Point2::new(6.0, 0.0)], 0.1);
        let (mut is_turning, mut widest) = (false, 0.0_f64);
        for _ in 0..(seconds / 0.02) as usize {
            let station = route.station(&pose, None).unwrap();
            let twist = LAW.steer(&route, &station, &pose, 0.0, 1.0, &mut is_turning);
            assert!(twist.linear >= 0.0 && twist.linear <= 0.4 && twist.angular.abs() <= 0.8 + 1e-12);
            pose = pose.integrate(&twist, 0.02);
            widest = widest.max(pose.y.abs());
        }
        (pose, widest)
    }

    #[test]
    fn the_robot_joins_the_path_and_slows_at_its_end() {
        let (pose, widest) = drive(Pose2::new(0.0, 0.5, 0.3), 8.0);
        assert!(pose.y.abs() < 0.03 && pose.theta.abs() < 0.05, "{pose:?}");
        assert!(widest < 0.7);
        let (end, _) = drive(Pose2::new(4.0, 0.1, 0.0), 9.0);
        assert!((end.x - 6.0).abs() < 0.4, "{end:?}");
    }

    #[test]
    fn a_robot_that_looks_back_turns_where_it_stands() {
        let (pose, _) = drive(Pose2::new(1.0, 0.0, 3.0), 1.0);
        assert!(pose.distance(&Pose2::new(1.0, 0.0, 0.0)) < 1e-9 && pose.theta < 2.5);
    }

    #[test]
    fn a_jump_is_taken_over_steadily() {
        let mut filter = JumpFilter::default();
        filter.jump(0.5);
        assert_eq!(filter.aside_m(), -0.5);
        filter.pass(1.0);
        assert!((filter.aside_m() + 0.3).abs() < 1e-12);
        filter.pass(5.0);
        assert_eq!(filter.aside_m(), 0.0);
    }
}
