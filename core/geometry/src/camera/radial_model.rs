//! A central omnidirectional camera, calibrated by a measured relation of image radius and direction.

use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mirror_camera::{Meridian, MirrorError};

/// Step between the image radii at which the profile is checked, pixels.
const CHECK_STEP_PX: f64 = 0.25;

/// A central camera whose image radius R (pixels) gives the angle from straight down by a [`RadialProfile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadialModel {
    profile: RadialProfile,
    /// Radius up to which the profile is monotonic, pixels.
    end_px: f64,
}

/// Relation of image radius and direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RadialProfile {
    /// The floor radius is `a tan(b R)`.
    Tangent {
        /// Factor a, m.
        range_m: f64,
        /// Factor b, rad per pixel.
        rad_per_px: f64,
        /// Height of the viewpoint above the floor during calibration, m.
        height_m: f64,
    },
    /// The floor radius in meters is a polynomial of R. Directions above the horizon are not covered.
    FloorPolynomial {
        /// Coefficients of R^0, R^1, ..., m.
        coefficients: Vec<f64>,
        /// Height of the viewpoint above the floor during calibration, m.
        height_m: f64,
    },
    /// The angle from straight down, rad, is a polynomial of R.
    AnglePolynomial {
        /// Coefficients of R^0, R^1, ..., rad.
        coefficients: Vec<f64>,
    },
}

impl RadialModel {
    /// Creates a model for image radii from the blind center to the rim, pixels.
    ///
    /// # Errors
    /// [`MirrorError::Profile`] if the angle does not grow with the radius or leaves 0 to pi; [`MirrorError::Shape`]
    /// for coefficients that are not finite or lengths that are not positive.
    pub fn new(
        profile: RadialProfile,
        blind_radius_px: f64,
        rim_radius_px: f64,
    ) -> Result<Self, MirrorError> {
        let usable = match &profile {
            RadialProfile::Tangent { range_m, rad_per_px, height_m } => {
                [range_m, rad_per_px, height_m].iter().all(|value| **value > 0.0 && value.is_finite())
            }
            RadialProfile::FloorPolynomial { coefficients, height_m } => {
                *height_m > 0.0 && !coefficients.is_empty() && coefficients.iter().all(|c| c.is_finite())
            }
            RadialProfile::AnglePolynomial { coefficients } => {
                !coefficients.is_empty() && coefficients.iter().all(|c| c.is_finite())
            }
        };
        if !usable {
            return Err(MirrorError::Shape("a profile needs finite coefficients, and lengths above 0"));
        }
        let model = Self { profile, end_px: rim_radius_px };
        let steps = ((rim_radius_px - blind_radius_px) / CHECK_STEP_PX).ceil().max(1.0) as usize;
        for i in 0..=steps {
            let radius_px = blind_radius_px + (rim_radius_px - blind_radius_px) * i as f64 / steps as f64;
            let angle = model.nadir_angle(radius_px);
            if !((0.0..std::f64::consts::PI).contains(&angle) && model.nadir_slope(radius_px) > 0.0) {
                return Err(MirrorError::Profile { radius_px });
            }
        }
        Ok(model)
    }

    /// Relation of image radius and direction.
    #[must_use]
    pub fn profile(&self) -> &RadialProfile {
        &self.profile
    }

    /// Returns the angle from straight down at an image radius, rad.
    fn nadir_angle(&self, radius_px: f64) -> f64 {
        match &self.profile {
            RadialProfile::Tangent { range_m, rad_per_px, height_m } => {
                let (sin, cos) = (rad_per_px * radius_px).sin_cos();
                let angle = (range_m * sin).atan2(height_m * cos);
                // A mirror shows no angle of pi or more.
                if rad_per_px * radius_px < std::f64::consts::PI { angle } else { f64::NAN }
            }
            RadialProfile::FloorPolynomial { coefficients, height_m } => {
                polynomial(coefficients, radius_px).atan2(*height_m)
            }
            RadialProfile::AnglePolynomial { coefficients } => polynomial(coefficients, radius_px),
        }
    }

    /// Finds the root of an increasing function between 0 and the rim.
    fn solve(&self, excess: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> Option<f64> {
        let (mut low, mut high) = (0.0, self.end_px);
        let tolerance = 1e-12 * self.end_px;
        if excess(high) < 0.0 {
            return None;
        }
        let mut radius_px = 0.5 * high;
        for _ in 0..80 {
            let over = excess(radius_px);
            (low, high) = if over > 0.0 { (low, radius_px) } else { (radius_px, high) };
            let newton = radius_px - over / slope(radius_px);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - radius_px).abs() <= tolerance {
                return (excess(next).abs() < 1e-6).then_some(next);
            }
            radius_px = next;
        }
        (excess(radius_px).abs() < 1e-6).then_some(radius_px)
    }
}

impl Meridian for RadialModel {
    fn viewpoint(&self) -> Vector2<f64> {
        Vector2::zeros()
    }

    fn direction(&self, radius_px: f64) -> Option<Vector2<f64>> {
        let angle = self.nadir_angle(radius_px);
        let inside = radius_px >= 0.0 && (0.0..std::f64::consts::PI).contains(&angle);
        inside.then(|| Vector2::new(angle.sin(), -angle.cos()))
    }

    fn radius_px(&self, direction: Vector2<f64>) -> Option<f64> {
        if direction.x < 0.0 || direction.x.is_nan() || direction.y.is_nan() {
            return None;
        }
        match &self.profile {
            RadialProfile::Tangent { range_m, rad_per_px, height_m } => {
                let radius_px = (direction.x * height_m).atan2(-direction.y * range_m) / rad_per_px;
                (radius_px <= self.end_px).then_some(radius_px)
            }
            RadialProfile::FloorPolynomial { coefficients, height_m } => {
                let floor_radius_m = (direction.y < 0.0).then(|| height_m * direction.x / -direction.y)?;
                self.solve(
                    |r| polynomial(coefficients, r) - floor_radius_m,
                    |r| polynomial_slope(coefficients, r),
                )
            }
            RadialProfile::AnglePolynomial { coefficients } => {
                let angle = direction.x.atan2(-direction.y);
                self.solve(|r| polynomial(coefficients, r) - angle, |r| polynomial_slope(coefficients, r))
            }
        }
    }

    fn nadir_slope(&self, radius_px: f64) -> f64 {
        match &self.profile {
            RadialProfile::Tangent { range_m, rad_per_px, height_m } => {
                let (sin, cos) = (rad_per_px * radius_px).sin_cos();
                rad_per_px * range_m * height_m / ((range_m * sin).powi(2) + (height_m * cos).powi(2))
            }
            RadialProfile::FloorPolynomial { coefficients, height_m } => {
                let r = polynomial(coefficients, radius_px);
                polynomial_slope(coefficients, radius_px) * height_m / (height_m * height_m + r * r)
            }
            RadialProfile::AnglePolynomial { coefficients } => polynomial_slope(coefficients, radius_px),
        }
    }
}

fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn polynomial_slope(coefficients: &[f64], x: f64) -> f64 {
    let terms = coefficients.iter().enumerate().skip(1).rev();
    terms.fold(0.0, |sum, (power, c)| sum * x + power as f64 * c)
}

/// A [`RadialModel`] as a robot file writes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RadialModelConfig {
    /// Relation between the image radius R, in pixels, and the direction.
    pub profile: RadialProfileConfig,
}

/// A [`RadialProfile`] as a robot file writes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "form", rename_all = "kebab-case", deny_unknown_fields)]
pub enum RadialProfileConfig {
    /// The floor radius is range_m tan(deg_per_px R).
    Tangent {
        /// Factor of the tangent.
        #[schemars(range(min = 0.001, max = 1000.0))]
        range_m: f64,
        /// Angle per pixel.
        #[schemars(range(min = 0.001, max = 10.0))]
        deg_per_px: f64,
        /// Height of the viewpoint above the floor during the measurement.
        #[schemars(range(min = 0.01, max = 10.0))]
        height_m: f64,
    },
    /// The floor radius in meters is a polynomial of R.
    FloorPolynomial {
        /// Coefficients of R⁰, R¹, ..., m.
        #[schemars(length(min = 1, max = 16), inner(range(min = -1e6, max = 1e6)))]
        coefficients: Vec<f64>,
        /// Height of the viewpoint above the floor during the measurement.
        #[schemars(range(min = 0.01, max = 10.0))]
        height_m: f64,
    },
    /// The angle from straight down in degrees is a polynomial of R.
    AnglePolynomial {
        /// Coefficients of R⁰, R¹, ..., degrees.
        #[schemars(length(min = 1, max = 16), inner(range(min = -1e6, max = 1e6)))]
        coefficients: Vec<f64>,
    },
}

impl RadialModelConfig {
    /// The checked model for image radii from the blind center to the rim, pixels.
    ///
    /// # Errors
    /// Same as [`RadialModel::new`].
    pub fn model(&self, blind_radius_px: f64, rim_radius_px: f64) -> Result<RadialModel, MirrorError> {
        let profile = match self.profile.clone() {
            RadialProfileConfig::Tangent { range_m, deg_per_px, height_m } => {
                RadialProfile::Tangent { range_m, rad_per_px: deg_per_px.to_radians(), height_m }
            }
            RadialProfileConfig::FloorPolynomial { coefficients, height_m } => {
                RadialProfile::FloorPolynomial { coefficients, height_m }
            }
            RadialProfileConfig::AnglePolynomial { mut coefficients } => {
                coefficients.iter_mut().for_each(|c| *c = c.to_radians());
                RadialProfile::AnglePolynomial { coefficients }
            }
        };
        RadialModel::new(profile, blind_radius_px, rim_radius_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn profiles() -> [RadialProfile; 3] {
        [
            RadialProfile::Tangent { range_m: 1.788, rad_per_px: 0.007_048, height_m: 0.6 },
            RadialProfile::FloorPolynomial { coefficients: vec![0.0, 4e-3, 0.0, 2e-7], height_m: 0.4 },
            RadialProfile::AnglePolynomial { coefficients: vec![0.01, 6e-3, 4e-6] },
        ]
    }

    #[test]
    fn the_tangent_gives_the_floor_radius_that_was_measured() {
        let model = RadialModel::new(profiles()[0].clone(), 31.0, 220.0).unwrap();
        let direction = model.direction(200.0).unwrap();
        let r = 0.6 * direction.x / -direction.y;
        assert!((r - 1.788 * (0.007_048_f64 * 200.0).tan()).abs() < 1e-9);
    }

    #[test]
    fn a_profile_that_does_not_grow_is_refused_with_the_radius() {
        let turning =
            RadialProfile::FloorPolynomial { coefficients: vec![0.0, 1e-2, -2.5e-5], height_m: 0.5 };
        let Err(MirrorError::Profile { radius_px }) = RadialModel::new(turning, 0.0, 240.0) else {
            panic!("the profile was accepted")
        };
        assert!((radius_px - 200.0).abs() < 0.3);
        let beyond = RadialProfile::Tangent { range_m: 1.0, rad_per_px: 0.02, height_m: 0.5 };
        assert!(matches!(RadialModel::new(beyond, 0.0, 240.0), Err(MirrorError::Profile { .. })));
        let empty = RadialProfile::AnglePolynomial { coefficients: vec![] };
        assert!(matches!(RadialModel::new(empty, 0.0, 240.0), Err(MirrorError::Shape(_))));
    }

    proptest! {
        #[test]
        fn radius_direction_radius(radius_px in 1.0..219.0, which in 0_usize..3) {
            let model = RadialModel::new(profiles()[which].clone(), 1.0, 220.0).unwrap();
            let direction = model.direction(radius_px).unwrap();
            let back = model.radius_px(direction * 3.0).unwrap();
            prop_assert!((back - radius_px).abs() < 1e-8, "{back}");
        }
    }
}
