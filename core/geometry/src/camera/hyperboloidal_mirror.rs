//! The hyperboloidal mirror above a camera that looks straight up; all rays meet in the mirror's focus.

use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mirror_camera::{Meridian, MirrorError};
use crate::Hypotenuse;

/// One sheet of a hyperboloid, coaxial with the camera, whose lens lies in the other focus.
///
/// Sekimori, Usui, Masutani & Miyazaki give the floor radius f(R) of an image radius R; this is the same mirror in
/// three dimensions, which covers walls as well.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HyperboloidalMirror {
    focal_px: f64,
    eccentricity: f64,
    foci_m: f64,
    /// k^2 - 1, k^2 + 1 and 2 k of the eccentricity k.
    below: f64,
    above: f64,
    twice: f64,
}

impl HyperboloidalMirror {
    /// Creates a mirror from the camera's focal length (pixels), the eccentricity (distance of the foci over distance
    /// of the vertices, above 1) and the distance of the foci (m).
    ///
    /// # Errors
    /// [`MirrorError::Shape`] outside these ranges.
    pub fn new(focal_px: f64, eccentricity: f64, foci_m: f64) -> Result<Self, MirrorError> {
        let usable = focal_px > 0.0 && eccentricity > 1.0 && foci_m >= 0.0;
        if !(usable && [focal_px, eccentricity, foci_m].iter().all(|value| value.is_finite())) {
            return Err(MirrorError::Shape("the eccentricity must be above 1, and lengths above 0"));
        }
        let square = eccentricity * eccentricity;
        let (below, above, twice) = (square - 1.0, square + 1.0, 2.0 * eccentricity);
        Ok(Self { focal_px, eccentricity, foci_m, below, above, twice })
    }

    /// Creates the mirror with a measured floor formula `r = R / (a - b sqrt(c + R^2))` (r in meters, R in pixels) and
    /// a lens `lens_height_m` above the floor.
    ///
    /// # Errors
    /// [`MirrorError::FloorFormula`] unless a^2 > b^2 c, all are above 0, and the focus lies above the lens.
    pub fn from_floor_formula(formula: FloorFormula, lens_height_m: f64) -> Result<Self, MirrorError> {
        let FloorFormula { a, b, c } = formula;
        let focal_px = c.sqrt();
        let ratio = a / (b * focal_px);
        if !(a > 0.0 && b > 0.0 && c > 0.0 && ratio > 1.0) {
            return Err(MirrorError::FloorFormula);
        }
        let eccentricity = ratio + ((ratio - 1.0) * (ratio + 1.0)).sqrt();
        let square = eccentricity * eccentricity;
        let focus_height_m = focal_px * (square + 1.0) / ((square - 1.0) * a);
        if focus_height_m < lens_height_m || !lens_height_m.is_finite() {
            return Err(MirrorError::FloorFormula);
        }
        Self::new(focal_px, eccentricity, focus_height_m - lens_height_m)
    }

    /// Returns the image radius of the horizon, pixels.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.focal_px * self.below / self.twice
    }
}

impl Meridian for HyperboloidalMirror {
    fn viewpoint(&self) -> Vector2<f64> {
        Vector2::new(0.0, self.foci_m)
    }

    fn direction(&self, radius_px: f64) -> Option<Vector2<f64>> {
        if !(radius_px >= 0.0 && radius_px.is_finite()) {
            return None;
        }
        let slant = radius_px.hypotenuse(self.focal_px);
        // The downward component is (k^2 + 1) F - 2 k sqrt(F^2 + R^2), expanded to avoid cancellation at the horizon.
        let horizon = self.below * self.focal_px;
        let drop = (horizon - self.twice * radius_px) * (horizon + self.twice * radius_px)
            / (self.above * self.focal_px + self.twice * slant);
        Some(Vector2::new(self.below * radius_px, -drop).normalize())
    }

    fn radius_px(&self, direction: Vector2<f64>) -> Option<f64> {
        let denominator = self.twice * direction.norm() - self.above * direction.y;
        (denominator > 0.0 && direction.x >= 0.0)
            .then(|| self.focal_px * self.below * direction.x / denominator)
    }

    fn nadir_slope(&self, radius_px: f64) -> f64 {
        let slant = radius_px.hypotenuse(self.focal_px);
        let (drop, across) = (self.above * self.focal_px - self.twice * slant, self.below * radius_px);
        self.below * (self.above * self.focal_px - self.twice * self.focal_px * self.focal_px / slant)
            / (drop * drop + across * across)
    }
}

/// The floor radius of an image radius, `r = R / (a - b sqrt(c + R^2))`, and its closed-form inverse.
///
/// Sekimori, Usui, Masutani & Miyazaki, section 2, and its inverse by squaring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FloorFormula {
    /// Coefficient a, pixels per meter.
    pub a: f64,
    /// Coefficient b, 1/m.
    pub b: f64,
    /// Coefficient c, square pixels.
    pub c: f64,
}

impl FloorFormula {
    /// Returns the floor radius (m) of an image radius (pixels), or `None` at or above the horizon.
    #[must_use]
    pub fn floor_radius_m(&self, radius_px: f64) -> Option<f64> {
        (radius_px >= 0.0 && radius_px < self.horizon_px())
            .then(|| radius_px / (self.a - self.b * (self.c + radius_px * radius_px).sqrt()))
    }

    /// Returns dr/dR, m per pixel: the floor error caused by a radial error of one pixel. `None` at or above the
    /// horizon.
    #[must_use]
    pub fn slope_m_per_px(&self, radius_px: f64) -> Option<f64> {
        let slant = (self.c + radius_px * radius_px).sqrt();
        let denominator = self.a - self.b * slant;
        (radius_px >= 0.0 && radius_px < self.horizon_px())
            .then(|| (self.a - self.b * self.c / slant) / (denominator * denominator))
    }

    /// Returns the image radius (pixels) of a floor radius (m, at least 0).
    #[must_use]
    pub fn radius_px(&self, floor_radius_m: f64) -> f64 {
        let d = self.discriminant();
        floor_radius_m * d / (self.a + self.b * (self.c + d * floor_radius_m * floor_radius_m).sqrt())
    }

    /// Returns the image radius of the horizon, pixels.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.discriminant().sqrt() / self.b
    }

    fn discriminant(&self) -> f64 {
        self.a * self.a - self.b * self.b * self.c
    }
}

/// A [`HyperboloidalMirror`] as a robot file writes it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HyperboloidalMirrorConfig {
    /// Focal length.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub focal_px: f64,
    /// Eccentricity k: distance of the foci divided by the distance of the vertices. The horizon appears at the radius
    /// focal_px (k - 1/k) / 2.
    #[schemars(range(min = 1.001, max = 10.0))]
    pub eccentricity: f64,
    /// Height of the mirror's focus, the viewpoint, above the lens center.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub foci_m: f64,
}

impl HyperboloidalMirrorConfig {
    /// The checked mirror.
    ///
    /// # Errors
    /// Same as [`HyperboloidalMirror::new`].
    pub fn mirror(&self) -> Result<HyperboloidalMirror, MirrorError> {
        HyperboloidalMirror::new(self.focal_px, self.eccentricity, self.foci_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MEASURED: FloorFormula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };

    fn sekimori() -> HyperboloidalMirror {
        HyperboloidalMirror::from_floor_formula(MEASURED, 0.165).unwrap()
    }

    #[test]
    fn the_measured_formula_is_a_mirror_with_its_focus_at_205_mm() {
        let mirror = sekimori();
        assert!((mirror.foci_m + 0.165 - 0.205_083_716_678_843_8).abs() < 1e-12);
        assert!((mirror.eccentricity - 1.265_184_851_497_194_8).abs() < 1e-12);
        assert!((mirror.horizon_px() - 113.800_296_468_541_84).abs() < 1e-9);
    }

    #[test]
    fn invalid_hyperboloids_are_refused() {
        assert!(HyperboloidalMirror::new(500.0, 1.0, 0.04).is_err());
        assert!(HyperboloidalMirror::new(500.0, f64::NAN, 0.04).is_err());
        let flat = FloorFormula { a: 9.8, ..MEASURED };
        assert_eq!(HyperboloidalMirror::from_floor_formula(flat, 0.165), Err(MirrorError::FloorFormula));
        assert_eq!(HyperboloidalMirror::from_floor_formula(MEASURED, 0.3), Err(MirrorError::FloorFormula));
    }

    proptest! {
        /// For every ray, the distances from lens and focus to the mirror differ by the same length: a hyperbola.
        #[test]
        fn rays_are_reflected_by_a_hyperboloid(radius_px in 0.5..300.0) {
            let mirror = sekimori();
            let out = mirror.direction(radius_px).unwrap();
            let to_mirror = Vector2::new(radius_px, mirror.focal_px).normalize();
            // Intersection of the ray of the lens with the line through the focus.
            let along = -mirror.viewpoint().perp(&out) / out.perp(&to_mirror);
            let hit = to_mirror * along;
            let difference = hit.norm() - (hit - mirror.viewpoint()).norm();
            prop_assert!((difference - mirror.foci_m / mirror.eccentricity).abs() < 1e-12);
        }

        #[test]
        fn formula_and_mirror_agree(radius_px in 0.0..113.7) {
            let mirror = sekimori();
            let direction = mirror.direction(radius_px).unwrap();
            let r = MEASURED.floor_radius_m(radius_px).unwrap();
            let height = 0.165 + mirror.foci_m;
            prop_assert!((r - height * direction.x / -direction.y).abs() < 1e-9 * (1.0 + r * r));
            prop_assert!((MEASURED.radius_px(r) - radius_px).abs() < 1e-9);
            let slope = mirror.nadir_slope(radius_px) * (height + r * r / height);
            prop_assert!((MEASURED.slope_m_per_px(radius_px).unwrap() - slope).abs() < 1e-9 * slope.max(1.0) * (1.0 + r));
        }
    }
}
