//! Motion from one velocity to another with limited acceleration.

use nalgebra::Vector2;

/// Motion in which the velocity changes linearly to another one with the maximum acceleration, and then is constant.
///
/// Sekimori, Usui, Masutani & Miyazaki, equation 8, and its integral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitedMotion {
    from_mps: Vector2<f64>,
    to_mps: Vector2<f64>,
    acceleration_mps2: Vector2<f64>,
    ramp_s: f64,
}

impl LimitedMotion {
    /// Creates the motion from the origin. The acceleration must be above 0.
    #[must_use]
    pub fn new(from_mps: Vector2<f64>, to_mps: Vector2<f64>, acceleration_mps2: f64) -> Self {
        let change = to_mps - from_mps;
        let size = change.norm();
        let along = if size > 0.0 { change / size } else { Vector2::zeros() };
        Self {
            from_mps,
            to_mps,
            acceleration_mps2: along * acceleration_mps2,
            ramp_s: size / acceleration_mps2,
        }
    }

    /// Returns the time until the target velocity is reached, s.
    #[must_use]
    pub fn ramp_s(&self) -> f64 {
        self.ramp_s
    }

    /// Returns the velocity after time `t` (s, at least 0), m/s.
    #[must_use]
    pub fn velocity_mps(&self, t: f64) -> Vector2<f64> {
        if t >= self.ramp_s { self.to_mps } else { self.from_mps + self.acceleration_mps2 * t }
    }

    /// Returns the position after time `t` (s, at least 0) relative to the start, m.
    #[inline]
    #[must_use]
    pub fn position_m(&self, t: f64) -> Vector2<f64> {
        let ramp = t.min(self.ramp_s);
        (self.from_mps + self.acceleration_mps2 * (0.5 * ramp)) * ramp + self.to_mps * (t - ramp)
    }

    /// Returns the maximum speed of the motion, m/s.
    #[must_use]
    pub fn max_speed_mps(&self) -> f64 {
        self.from_mps.norm().max(self.to_mps.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn position_is_the_integral_of_a_velocity_with_limited_acceleration() {
        let motion = LimitedMotion::new(Vector2::new(0.4, -0.1), Vector2::new(-0.2, 0.3), 0.5);
        let h = 1e-4;
        for step in 0..300 {
            let t = 0.01 * f64::from(step);
            let change = motion.velocity_mps(t + h) - motion.velocity_mps(t);
            assert!(change.norm() <= 0.5 * h * (1.0 + 1e-9));
            let difference = (motion.position_m(t + h) - motion.position_m(t)) / h;
            assert!((difference - motion.velocity_mps(t + 0.5 * h)).norm() < 1e-4, "at {t}");
        }
        assert_eq!(motion.velocity_mps(motion.ramp_s()), Vector2::new(-0.2, 0.3));
        let still = LimitedMotion::new(Vector2::zeros(), Vector2::zeros(), 0.5);
        assert_eq!((still.ramp_s(), still.position_m(3.0)), (0.0, Vector2::zeros()));
    }
}
