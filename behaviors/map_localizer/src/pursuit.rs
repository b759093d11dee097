//! Pure pursuit along a path.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, Twist, angle_difference};

use crate::route::{PathProgress, Route};

/// Bearing of the target point above which the robot first turns in place, rad.
const TURN_FIRST_RAD: f64 = 1.05;
/// Bearing of the target point at which a turn in place ends, rad.
const TURNED_RAD: f64 = 0.26;
/// Turn rate per heading error while turning in place, 1/s.
const TURN_GAIN: f64 = 1.5;
/// Deceleration toward the goal, m/s².
const BRAKING_MPS2: f64 = 0.3;
/// Minimum speed of the approach to the goal, m/s.
const CREEP_MPS: f64 = 0.06;
/// Rate at which the steering follows a jump of the pose, m/s.
const JUMP_RATE_MPS: f64 = 0.2;

/// Pure pursuit control law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PurePursuit {
    /// Cruising speed, m/s.
    pub speed_mps: f64,
    /// Distance along the path to the target point, m.
    pub look_ahead_m: f64,
    /// Maximum turn rate, rad/s.
    pub max_turn_radps: f64,
}

/// State of the robot for one step of [`PurePursuit::steer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteerInput {
    /// Pose in the map frame.
    pub pose: Pose2,
    /// Offset added to the lateral error, m, positive to the left; see [`JumpFilter`].
    pub lateral_offset_m: f64,
    /// Fraction of the cruising speed, 0 to 1.
    pub speed_factor: f64,
}

impl PurePursuit {
    /// Returns the twist along the path. `is_turning` is true while the robot turns in place; the call reads and
    /// updates it.
    #[must_use]
    pub fn steer(
        &self,
        route: &Route,
        progress: &PathProgress,
        input: &SteerInput,
        is_turning: &mut bool,
    ) -> Twist {
        let SteerInput { pose, lateral_offset_m, speed_factor } = *input;
        let (sin, cos) = progress.heading_rad.sin_cos();
        let pose = Pose2 { x: pose.x - sin * lateral_offset_m, y: pose.y + cos * lateral_offset_m, ..pose };
        let ahead_m = self.look_ahead_m.min(progress.to_go_m.max(0.3));
        let Some(mut target) = route.point_at(progress.progress_m + ahead_m) else { return Twist::ZERO };
        if progress.to_go_m < ahead_m {
            // The last leg is extended past the goal, so that the bearing of the target stays stable near it.
            target += nalgebra::Vector2::new(cos, sin) * (ahead_m - progress.to_go_m);
        }
        let in_robot = point_in_robot(&pose, target);
        let bearing = in_robot.y.atan2(in_robot.x);
        *is_turning = bearing.abs() > if *is_turning { TURNED_RAD } else { TURN_FIRST_RAD };
        if *is_turning {
            let rate = (TURN_GAIN * bearing).clamp(-self.max_turn_radps, self.max_turn_radps);
            return Twist::planar(0.0, rate);
        }
        let braking = (2.0 * BRAKING_MPS2 * progress.to_go_m.max(0.0)).sqrt().max(CREEP_MPS);
        let speed = (speed_factor * self.speed_mps).min(braking) * bearing.cos().max(0.2);
        let curvature = 2.0 * in_robot.y / in_robot.coords.norm_squared().max(0.01);
        let turn = speed * curvature;
        if turn.abs() > self.max_turn_radps {
            // Same curvature at a lower speed.
            let factor = self.max_turn_radps / turn.abs();
            return Twist::planar(speed * factor, turn * factor);
        }
        Twist::planar(speed, turn)
    }
}

/// Returns the turn in place from one heading toward another (rad), at most at `max_radps`.
#[must_use]
pub fn turn_toward(heading: f64, target: f64, max_radps: f64) -> Twist {
    let rate = TURN_GAIN * angle_difference(target, heading);
    Twist::planar(0.0, rate.clamp(-max_radps, max_radps))
}

fn point_in_robot(pose: &Pose2, point: Point2<f64>) -> Point2<f64> {
    pose.inverse().transform_point(point)
}

/// Rate limiter for jumps of the lateral error: a correction of the pose changes the error at once, and the steering
/// follows it at a limited rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JumpFilter {
    pending_m: f64,
}

impl JumpFilter {
    /// Adds a jump of the lateral error, m, positive to the left; ignores it if not finite.
    pub fn add(&mut self, lateral_m: f64) {
        if lateral_m.is_finite() {
            self.pending_m += lateral_m;
        }
    }

    /// Reduces the pending jump by the rate limit times `elapsed_s`.
    pub fn advance_time(&mut self, elapsed_s: f64) {
        let step = JUMP_RATE_MPS * elapsed_s.clamp(0.0, 10.0);
        self.pending_m -= self.pending_m.clamp(-step, step);
    }

    /// Returns the offset to add to the lateral error before steering, m.
    #[must_use]
    pub fn lateral_offset_m(&self) -> f64 {
        -self.pending_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: PurePursuit = PurePursuit { speed_mps: 0.4, look_ahead_m: 0.8, max_turn_radps: 0.8 };

    fn drive(mut pose: Pose2, seconds: f64) -> (Pose2, f64) {
        let route = Route::new(vec![Point2::new(0.0, 0.0), Point2::new(6.0, 0.0)], 0.1);
        let (mut is_turning, mut widest) = (false, 0.0_f64);
        for _ in 0..(seconds / 0.02) as usize {
            let progress = route.progress(&pose, None).unwrap();
            let input = SteerInput { pose, lateral_offset_m: 0.0, speed_factor: 1.0 };
            let twist = LAW.steer(&route, &progress, &input, &mut is_turning);
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
    fn a_robot_that_faces_backward_turns_in_place() {
        let (pose, _) = drive(Pose2::new(1.0, 0.0, 3.0), 1.0);
        assert!(pose.distance(&Pose2::new(1.0, 0.0, 0.0)) < 1e-9 && pose.theta < 2.5);
    }

    #[test]
    fn a_jump_is_followed_at_a_limited_rate() {
        let mut filter = JumpFilter::default();
        filter.add(0.5);
        assert_eq!(filter.lateral_offset_m(), -0.5);
        filter.advance_time(1.0);
        assert!((filter.lateral_offset_m() + 0.3).abs() < 1e-12);
        filter.advance_time(5.0);
        assert_eq!(filter.lateral_offset_m(), 0.0);
    }
}
