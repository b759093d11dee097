//! Dead reckoning of the pose and its covariance.

use nalgebra::{Matrix2, Matrix3, Matrix3x2};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;

/// Small motion between two odometry messages. Lateral motion is not modeled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Distance driven forward, m.
    pub forward_m: f64,
    /// Angle turned to the left, rad.
    pub turn_rad: f64,
}

/// Noise model of dead reckoning: variances added by motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionNoise {
    /// Variance of the distance per distance driven, m²/m.
    pub distance_per_distance_m: f64,
    /// Variance of the heading per angle turned, rad²/rad.
    pub turn_per_turn_rad: f64,
    /// Variance of the heading per distance driven, rad²/m.
    pub turn_per_distance: f64,
    /// Standard deviation of a constant drift of the heading, for example from unequal wheels, rad/m.
    pub drift_per_distance: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self {
            distance_per_distance_m: 1e-4,
            turn_per_turn_rad: 1e-3,
            turn_per_distance: 2e-4,
            drift_per_distance: 0.0,
        }
    }
}

impl Increment {
    /// Returns the motion between two poses in the odometry frame, along the mean heading.
    #[must_use]
    pub fn between(from: &Pose2, to: &Pose2) -> Self {
        let motion = from.relative(to);
        let (sin, cos) = (0.5 * motion.theta).sin_cos();
        Self { forward_m: motion.x * cos + motion.y * sin, turn_rad: motion.theta }
    }

    /// Returns a fraction of the motion.
    #[must_use]
    pub fn scaled(&self, fraction: f64) -> Self {
        Self { forward_m: fraction * self.forward_m, turn_rad: fraction * self.turn_rad }
    }

    /// Returns the pose after the motion, along the mean heading.
    #[must_use]
    pub fn move_pose(&self, pose: &Pose2) -> Pose2 {
        let (sin, cos) = (pose.theta + 0.5 * self.turn_rad).sin_cos();
        Pose2::new(pose.x + self.forward_m * cos, pose.y + self.forward_m * sin, pose.theta + self.turn_rad)
    }

    /// Returns the belief after the motion. `driven_m` is the distance driven since the last correction.
    #[must_use]
    pub fn move_belief(&self, belief: &Belief, driven_m: f64, noise: &MotionNoise) -> Belief {
        let covariance = self.move_covariance(&belief.covariance, belief.pose.theta, driven_m, noise);
        Belief { pose: self.move_pose(&belief.pose), covariance }
    }

    /// Returns the covariance after the motion from `heading` (rad): F P F' + G M G'. `driven_m` is the distance driven
    /// since the last correction.
    #[must_use]
    pub fn move_covariance(
        &self,
        covariance: &Matrix3<f64>,
        heading: f64,
        driven_m: f64,
        noise: &MotionNoise,
    ) -> Matrix3<f64> {
        let distance = self.forward_m;
        let (sin, cos) = (heading + 0.5 * self.turn_rad).sin_cos();
        let state = Matrix3::new(1.0, 0.0, -distance * sin, 0.0, 1.0, distance * cos, 0.0, 0.0, 1.0);
        let input = Matrix3x2::new(cos, -0.5 * distance * sin, sin, 0.5 * distance * cos, 0.0, 1.0);
        let distance_variance = noise.distance_per_distance_m * distance.abs();
        // A constant drift adds to the standard deviation linearly with distance, not to the variance.
        let drift_variance =
            noise.drift_per_distance.powi(2) * distance.abs() * (2.0 * driven_m + distance.abs());
        let turn_variance = noise.turn_per_turn_rad * self.turn_rad.abs()
            + noise.turn_per_distance * distance.abs()
            + drift_variance;
        let moved = state * covariance * state.transpose()
            + input * Matrix2::new(distance_variance, 0.0, 0.0, turn_variance) * input.transpose();
        0.5 * (moved + moved.transpose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_increment_connects_two_poses() {
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
