//! Dead reckoning of the pose and its covariance.

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector3};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;

/// Small motion between two odometry messages. Lateral motion is not modeled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Distance driven forward, m.
    pub forward_m: f64,
    /// Angle turned to the left, rad.
    pub turn_rad: f64,
    /// Variance of the angle due to wheels that slip, rad².
    pub slip_variance: f64,
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
    /// Standard deviation of the delay between the motion of the body and the motion that odometry reports, s: wheels
    /// creep on the floor while speeds change.
    pub delay_s: f64,
    /// Slip of the wheels while braking and starting.
    pub slip: SlipNoise,
}

/// Standard deviation of the heading due to slip while the speed changes: `gain` × (acceleration − `from_mps2`), in each
/// [`SLIP_INTERVAL_S`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlipNoise {
    /// Acceleration or deceleration up to which wheels do not slip, m/s².
    pub from_mps2: f64,
    /// Standard deviation per acceleration beyond that, rad per m/s².
    pub gain: f64,
}

/// Interval in which [`SlipNoise`] is the standard deviation of the heading, s.
pub const SLIP_INTERVAL_S: f64 = 0.1;
/// Time constant of the low-pass filter of speeds, s: longer than the quantization of wheel encoders is coarse.
const SPEED_FILTER_S: f64 = 0.06;

impl SlipNoise {
    /// Returns the variance of the heading after [`SLIP_INTERVAL_S`] at this acceleration (m/s²), rad².
    #[must_use]
    pub fn variance(&self, acceleration_mps2: f64) -> f64 {
        (self.gain * (acceleration_mps2.abs() - self.from_mps2).max(0.0)).powi(2)
    }
}

/// Speeds of the robot by odometry, low-pass filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speeds {
    /// Forward, m/s.
    pub forward_mps: f64,
    /// Turn rate to the left, rad/s.
    pub turn_radps: f64,
}

impl Speeds {
    /// Returns the speeds after a motion in `elapsed_s` > 0, and the acceleration forward, m/s².
    #[must_use]
    pub fn after(&self, motion: &Increment, elapsed_s: f64) -> (Self, f64) {
        let share = elapsed_s / (SPEED_FILTER_S + elapsed_s);
        let toward = |now: f64, moved: f64| now + share * (moved / elapsed_s - now);
        let speeds = Self {
            forward_mps: toward(self.forward_mps, motion.forward_m),
            turn_radps: toward(self.turn_radps, motion.turn_rad),
        };
        (speeds, (speeds.forward_mps - self.forward_mps) / elapsed_s)
    }
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self {
            distance_per_distance_m: 1e-4,
            turn_per_turn_rad: 1e-3,
            turn_per_distance: 2e-4,
            drift_per_distance: 0.0,
            delay_s: 0.0,
            slip: SlipNoise::default(),
        }
    }
}

impl MotionNoise {
    /// Returns the covariance (x, y, theta) of the pose due to the delay of odometry, for a robot with this heading
    /// (rad) whose speeds changed since its last correction.
    #[must_use]
    pub fn delay_covariance(&self, heading: f64, from: &Speeds, to: &Speeds) -> Matrix3<f64> {
        let (sin, cos) = heading.sin_cos();
        let ahead = self.delay_s * (to.forward_mps - from.forward_mps);
        let aside = self.delay_s * (to.turn_radps - from.turn_radps);
        let along = Vector3::new(cos, sin, 0.0) * ahead;
        let mut covariance = along * along.transpose();
        covariance[(2, 2)] = aside * aside;
        covariance
    }
}

impl Increment {
    /// Returns the motion between two poses in the odometry frame, along the mean heading.
    #[must_use]
    pub fn between(from: &Pose2, to: &Pose2) -> Self {
        let motion = from.relative(to);
        let (sin, cos) = (0.5 * motion.theta).sin_cos();
        Self { forward_m: motion.x * cos + motion.y * sin, turn_rad: motion.theta, slip_variance: 0.0 }
    }

    /// Returns a fraction of the motion.
    #[must_use]
    pub fn scaled(&self, fraction: f64) -> Self {
        Self {
            forward_m: fraction * self.forward_m,
            turn_rad: fraction * self.turn_rad,
            slip_variance: fraction.abs() * self.slip_variance,
        }
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
            + drift_variance
            + self.slip_variance;
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
            Increment { forward_m: 0.02, turn_rad: 0.01, slip_variance: 0.0 },
            Increment { forward_m: -0.3, turn_rad: 0.4, slip_variance: 0.0 },
            Increment { forward_m: 0.0, turn_rad: -0.2, slip_variance: 0.0 },
        ] {
            let to = increment.move_pose(&from);
            let again = Increment::between(&from, &to);
            assert!((again.forward_m - increment.forward_m).abs() < 1e-12);
            assert!((again.turn_rad - increment.turn_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn hard_braking_makes_the_heading_uncertain_and_steady_motion_does_not() {
        let slip = SlipNoise { from_mps2: 0.3, gain: 0.02 };
        let sigma_deg = |deceleration: f64| {
            let (mut speeds, mut variance) = (Speeds { forward_mps: 0.4, turn_radps: 0.0 }, 0.0);
            let mut speed = 0.4_f64;
            for _ in 0..50 {
                speed = (speed - 0.02 * deceleration).max(0.0);
                let motion = Increment { forward_m: 0.02 * speed, ..Increment::default() };
                let (after, acceleration) = speeds.after(&motion, 0.02);
                speeds = after;
                variance += slip.variance(acceleration) * 0.02 / SLIP_INTERVAL_S;
            }
            variance.sqrt().to_degrees()
        };
        assert_eq!(sigma_deg(0.0), 0.0);
        assert!((0.4..1.5).contains(&sigma_deg(1.0)), "{}", sigma_deg(1.0));
        assert!((1.5..6.0).contains(&sigma_deg(3.0)), "{}", sigma_deg(3.0));
    }
}
