//! Dead reckoning with its covariance.

use nalgebra::{Matrix2, Matrix3, Matrix3x2};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;

/// A small motion between two readings of the odometry. Sideways motion is not in it: the robot drives forward and turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Forward, meters.
    pub forward_m: f64,
    /// To the left, radians.
    pub turn_rad: f64,
}

/// How uncertain motion is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionNoise {
    /// Variance of the way that a meter adds, m^2 / m.
    pub way_per_way_m: f64,
    /// Variance of the heading that a radian of turning adds, rad^2 / rad.
    pub turn_per_turn_rad: f64,
    /// Variance of the heading that a meter adds, rad^2 / m.
    pub turn_per_way: f64,
    /// Standard deviation of a drift of the heading that stays the same, such as that of unequal wheels, rad / m.
    pub drift_per_way: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self { way_per_way_m: 1e-4, turn_per_turn_rad: 1e-3, turn_per_way: 2e-4, drift_per_way: 0.0 }
    }
}

impl Increment {
    /// The motion between two poses of the odometry frame, along the heading half way.
    #[must_use]
    pub fn between(from: &Pose2, to: &Pose2) -> Self {
        let motion = from.relative(to);
        let (sin, cos) = (0.5 * motion.theta).sin_cos();
        Self { forward_m: motion.x * cos + motion.y * sin, turn_rad: motion.theta }
    }

    /// A share of it.
    #[must_use]
    pub fn share(&self, share: f64) -> Self {
        Self { forward_m: share * self.forward_m, turn_rad: share * self.turn_rad }
    }

    /// The pose after this motion: forward along the heading half way.
    #[must_use]
    pub fn move_pose(&self, pose: &Pose2) -> Pose2 {
        let (sin, cos) = (pose.theta + 0.5 * self.turn_rad).sin_cos();
        Pose2::new(pose.x + self.forward_m * cos, pose.y + self.forward_m * sin, pose.theta + self.turn_rad)
    }

    /// The belief after this motion, `driven_m` after the pose was last seen.
    #[must_use]
    pub fn move_belief(&self, belief: &Belief, driven_m: f64, noise: &MotionNoise) -> Belief {
        let covariance = self.move_covariance(&belief.covariance, belief.pose.theta, driven_m, noise);
        Belief { pose: self.move_pose(&belief.pose), covariance }
    }

    /// The covariance after this motion from `heading` (rad), `driven_m` after the pose was last seen: F P F' + G M G'.
    #[must_use]
    pub fn move_covariance(
        &self,
        covariance: &Matrix3<f64>,
        heading: f64,
        driven_m: f64,
        noise: &MotionNoise,
    ) -> Matrix3<f64> {
        let way = self.forward_m;
        let (sin, cos) = (heading + 0.5 * self.turn_rad).sin_cos();
        let state = Matrix3::new(1.0, 0.0, -way * sin, 0.0, 1.0, way * cos, 0.0, 0.0, 1.0);
        let input = Matrix3x2::new(cos, -0.5 * way * sin, sin, 0.5 * way * cos, 0.0, 1.0);
        let of_way = noise.way_per_way_m * way.abs();
        // What a drift makes of the heading grows with the way, not with its root.
        let of_drift = noise.drift_per_way.powi(2) * way.abs() * (2.0 * driven_m + way.abs());
        let of_turn =
            noise.turn_per_turn_rad * self.turn_rad.abs() + noise.turn_per_way * way.abs() + of_drift;
        let moved = state * covariance * state.transpose()
            + input * Matrix2::new(of_way, 0.0, 0.0, of_turn) * input.transpose();
        0.5 * (moved + moved.transpose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_increment_leads_from_one_pose_to_the_other() {
        let from = Pose2::new(1.0, 2.0, 3.0);
        for increment in [
            Increment { forward_m: 0.02, turn_rad: 0.01 },
            Increment { forward_m: -0.3, turn_rad: 0.4 },
            Increment { forward_m: 0.0, turn_rad: -0.2 },
        ] {
            let to = increment.move_pose(&from);
            let again = Increment::between(&from, &to);
            assert!((again.forward_m - increment.forward_m).abs() < 1e-12);
            assert!((again.turn_rad - increment.turn_rad).abs() < 1e-12);
        }
    }
}
