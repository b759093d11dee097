//! Brown-Conrady distortion of a lens.

use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Brown-Conrady distortion of normalized coordinates: radial k1, k2, k3 and tangential p1, p2; all zero means none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Distortion {
    /// Radial coefficient of r².
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k1: f64,
    /// Radial coefficient of r⁴.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k2: f64,
    /// First tangential coefficient.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub p1: f64,
    /// Second tangential coefficient.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub p2: f64,
    /// Radial coefficient of r⁶.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k3: f64,
}

impl Distortion {
    /// No distortion.
    pub const NONE: Self = Self { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };

    /// Returns the distorted normalized coordinates of an ideal point.
    #[must_use]
    pub fn distort(&self, ideal: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// Returns the Jacobian of [`Distortion::distort`] at an ideal point.
    #[must_use]
    pub fn jacobian(&self, ideal: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        let slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + 3.0 * self.k3 * r2));
        let cross = slope * x * y + 2.0 * (self.p1 * x + self.p2 * y);
        Matrix2::new(
            radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            cross,
            cross,
            radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// Returns the squared ideal radius up to which the radial distortion is monotonic, or infinity if it is
    /// everywhere.
    pub(super) fn valid_radius_squared(&self) -> f64 {
        let derivative = |q: f64| 1.0 + q * (3.0 * self.k1 + q * (5.0 * self.k2 + q * 7.0 * self.k3));
        let (steps, end) = (400, 16.0);
        let first_negative =
            (1..=steps).map(|i| end * f64::from(i) / f64::from(steps)).find(|&q| derivative(q) <= 0.0);
        let Some(mut high) = first_negative else { return f64::INFINITY };
        let mut low = high - end / f64::from(steps);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if derivative(middle) > 0.0 { low = middle } else { high = middle }
        }
        low
    }

    fn radial(&self, r2: f64) -> f64 {
        1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
    }
}
