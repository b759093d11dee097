//! From one velocity to another with a limited acceleration.

use nalgebra::Vector2;

/// The velocity changes straight from one to another, as fast as the acceleration allows, and then stays.
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
    /// The motion that starts at the origin; the acceleration is above 0.
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

    /// Time until the velocity is reached, s.
    #[must_use]
    pub fn ramp_s(&self) -> f64 {
        self.ramp_s
    }

    /// Velocity after `t` (s, at least 0), m/s.
    #[must_use]
    pub fn velocity_mps(&self, t: f64) -> Vector2<f64> {
        if t >= self.ramp_s { self.to_mps } else { self.from_mps + self.acceleration_mps2 * t }
    }

    /// Place after `t` (s, at least 0), m from the start.
    #[inline]
    #[must_use]
    pub fn position_m(&self, t: f64) -> Vector2<f64> {
        let ramp = t.min(self.ramp_s);
        (self.from_mps + self.acceleration_mps2 * (0.5 * ramp)) * ramp + self.to_mps * (t - ramp)
    }

    /// The highest speed on the way, m/s.
    #[must_use]
    pub fn fastest_mps(&self) -> f64 {
        self.from_mps.norm().max(self.to_mps.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn position_is_the_integral_of_a_velocity_that_changes_slowly_enough() {
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
