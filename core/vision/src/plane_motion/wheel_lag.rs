//! Time by which wheel odometry lags behind pictures, estimated while the robot drives.
//!
//! Encoders and cameras are stamped with different delays, and wheels that slip while the speed changes act like a
//! delay. At a constant speed a lag shifts all pictures alike and does no harm; between pictures at different speeds it
//! is an error of several centimeters or degrees. A time offset as a slow state: Li & Mourikis (2014).

use nalgebra::Vector2;
use yamabico_geometry::{Pose2, Twist};

/// Standard deviation of the lag before anything was learned, s.
const START_SIGMA_S: f64 = 0.1;
/// Growth of the deviation from one picture to the next, s.
const DRIFT_S: f64 = 2e-3;
/// Smallest deviation, s: a lag does not describe slip exactly.
const MIN_SIGMA_S: f64 = 0.02;
/// Bound of the lag, s.
const MAX_LAG_S: f64 = 0.3;
/// Smallest changes of speed from which the lag is learned, m/s and rad/s.
const MIN_CHANGE: Vector2<f64> = Vector2::new(0.04, 0.08);
/// Standard deviations of an aligned distance (m) and turn (rad).
const SIGMAS: Vector2<f64> = Vector2::new(6e-3, 8e-3);

/// Slow estimate of the lag.
#[derive(Clone, Copy, Debug)]
pub struct WheelLag {
    lag_s: f64,
    variance: f64,
}

impl Default for WheelLag {
    fn default() -> Self {
        Self { lag_s: 0.0, variance: START_SIGMA_S * START_SIGMA_S }
    }
}

impl WheelLag {
    /// Lag, s; positive if the wheels tell a motion later than pictures show it.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.lag_s
    }

    /// Standard deviation of the lag, s.
    #[must_use]
    pub fn sigma_s(&self) -> f64 {
        self.variance.sqrt()
    }

    /// Pose at a picture, for `odometry` read at its stamp while the wheels turned with `twist`.
    #[must_use]
    pub fn lead(&self, odometry: &Pose2, twist: &Twist) -> Pose2 {
        odometry.integrate(twist, self.lag_s)
    }

    /// Learns from the motion between two pictures, by `wheels` and `aligned`, while the velocity along x and about
    /// the vertical changed by `change` (m/s, rad/s).
    pub fn learn(&mut self, wheels: &Pose2, aligned: &Pose2, change: Vector2<f64>) {
        self.variance += DRIFT_S * DRIFT_S;
        let shift = Vector2::new(aligned.x - wheels.x, aligned.theta - wheels.theta);
        for axis in 0..2 {
            if change[axis].abs() < MIN_CHANGE[axis] {
                continue;
            }
            let innovation = shift[axis] - self.lag_s * change[axis];
            let spread = change[axis].powi(2) * self.variance + SIGMAS[axis].powi(2);
            if innovation * innovation > 16.0 * spread {
                continue;
            }
            let gain = self.variance * change[axis] / spread;
            self.lag_s = (self.lag_s + gain * innovation).clamp(-MAX_LAG_S, MAX_LAG_S);
            self.variance *= 1.0 - gain * change[axis];
        }
        self.variance = self.variance.clamp(MIN_SIGMA_S * MIN_SIGMA_S, START_SIGMA_S * START_SIGMA_S);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_is_learned_from_changes_of_speed_alone() {
        let mut lag = WheelLag::default();
        for i in 0..40 {
            let change = if i % 4 == 0 { 0.3 } else { 0.0 };
            let wheels = Pose2::new(0.16, 0.0, 0.0);
            let aligned = Pose2::new(0.16 + 0.15 * change, 0.0, 0.0);
            lag.learn(&wheels, &aligned, Vector2::new(change, 0.0));
        }
        assert!((lag.seconds() - 0.15).abs() < 0.01, "{lag:?}");
        assert!(lag.sigma_s() < 0.03);
        let led = lag.lead(&Pose2::IDENTITY, &Twist::new(0.4, 0.0, 0.0));
        assert!((led.x - 0.06).abs() < 0.005);
    }

    #[test]
    fn an_impossible_lag_is_not_learned() {
        let mut lag = WheelLag::default();
        lag.learn(&Pose2::IDENTITY, &Pose2::new(0.5, 0.0, 0.0), Vector2::new(0.1, 0.0));
        assert_eq!(lag.seconds(), 0.0);
    }
}
