//! The hyperboloidal mirror above a camera that looks straight up: all rays meet in the mirror's focus.

use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mirror_camera::{Meridian, MirrorError};

/// A sheet of a hyperboloid, coaxial with the camera, whose lens sits in the other focus.
///
/// Sekimori, Usui, Masutani & Miyazaki give the floor radius f(R) of an image radius R; this is the same mirror in
/// three dimensions, so that walls are seen as well.
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
    /// A mirror seen with this focal length (pixels), of this eccentricity (the distance of the foci over that of the
    /// vertices, above 1), whose foci are this far apart (meters).
    ///
    /// # Errors
    /// [`MirrorError::Shape`] outside these ranges.
    pub fn new(focal_px: f64, eccentricity: f64, foci_m: f64) -> Result<Self, MirrorError> {
        let usable = focal_px > 0.0 && eccentricity > 1.0 && foci_m >= 0.0;
        if !(usable && [focal_px, eccentricity, foci_m].iter().all(|value| value.is_finite())) {
            return Err(MirrorError::Shape("the eccentricity is above 1, lengths are above 0"));
        }
        let square = eccentricity * eccentricity;
        let (below, above, twice) = (square - 1.0, square + 1.0, 2.0 * eccentricity);
        Ok(Self { focal_px, eccentricity, foci_m, below, above, twice })
    }

    /// The mirror that a measured floor formula `r = R / (a - b sqrt(c + R^2))` (r in meters, R in pixels) belongs to,
    /// with the lens `lens_height_m` above the floor.
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

    /// Distance from the axis (pixels) at which the horizon is seen.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.focal_px * self.below / self.twice
    }

    /// The formula for the floor below an upright mirror whose lens is `lens_height_m` above it.
    #[must_use]
    pub fn floor_formula(&self, lens_height_m: f64) -> FloorFormula {
        let scale = 1.0 / (self.below * (lens_height_m + self.foci_m));
        FloorFormula {
            a: self.focal_px * self.above * scale,
            b: self.twice * scale,
            c: self.focal_px * self.focal_px,
        }
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
        let slant = radius_px.hypot(self.focal_px);
        // The drop is (k^2 + 1) F - 2 k sqrt(F^2 + R^2), multiplied out so that nothing cancels at the horizon.
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
        let slant = radius_px.hypot(self.focal_px);
        let (drop, across) = (self.above * self.focal_px - self.twice * slant, self.below * radius_px);
        self.below * (self.above * self.focal_px - self.twice * self.focal_px * self.focal_px / slant)
            / (drop * drop + across * across)
    }
}

/// The floor radius of an image radius, `r = R / (a - b sqrt(c + R^2))`, and its closed inverse.
///
/// Sekimori, Usui, Masutani & Miyazaki, section 2, and its inverse by squaring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FloorFormula {
    /// Pixels per meter.
    pub a: f64,
    /// One per meter.
    pub b: f64,
    /// Square pixels.
    pub c: f64,
}

impl FloorFormula {
    /// Floor radius r in meters of an image radius in pixels; `None` at and beyond the horizon.
    #[must_use]
    pub fn floor_radius_m(&self, radius_px: f64) -> Option<f64> {
        (radius_px >= 0.0 && radius_px < self.horizon_px())
            .then(|| radius_px / (self.a - self.b * (self.c + radius_px * radius_px).sqrt()))
    }

    /// dr/dR, meters per pixel: what one pixel of radial error does on the floor; `None` at and beyond the horizon.
    #[must_use]
    pub fn slope_m_per_px(&self, radius_px: f64) -> Option<f64> {
        let slant = (self.c + radius_px * radius_px).sqrt();
        let denominator = self.a - self.b * slant;
        (radius_px >= 0.0 && radius_px < self.horizon_px())
            .then(|| (self.a - self.b * self.c / slant) / (denominator * denominator))
    }

    /// Image radius in pixels of a floor radius in meters (at least 0).
    #[must_use]
    pub fn radius_px(&self, floor_radius_m: f64) -> f64 {
        let d = self.discriminant();
        floor_radius_m * d / (self.a + self.b * (self.c + d * floor_radius_m * floor_radius_m).sqrt())
    }

    /// Distance from the axis (pixels) at which the horizon is seen.
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
    /// Focal length, pixels, 1 to 100000.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub focal_px: f64,
    /// Distance of the foci over that of the vertices, 1.001 to 10: the horizon is seen at focal_px (k - 1/k) / 2.
    #[schemars(range(min = 1.001, max = 10.0))]
    pub eccentricity: f64,
    /// From the lens center up to the mirror's focus, from which it seems to look, m, 0 to 5.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub foci_m: f64,
}

impl HyperboloidalMirrorConfig {
    /// The checked mirror.
    ///
    /// # Errors
    /// As [`HyperboloidalMirror::new`].
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
        let back = mirror.floor_formula(0.165);
        assert!((back.a - MEASURED.a).abs() < 1e-8 && (back.b - MEASURED.b).abs() < 1e-11);
    }

    #[test]
    fn what_is_no_hyperboloid_is_refused() {
        assert!(HyperboloidalMirror::new(500.0, 1.0, 0.04).is_err());
        assert!(HyperboloidalMirror::new(500.0, f64::NAN, 0.04).is_err());
        let flat = FloorFormula { a: 9.8, ..MEASURED };
        assert_eq!(HyperboloidalMirror::from_floor_formula(flat, 0.165), Err(MirrorError::FloorFormula));
        assert_eq!(HyperboloidalMirror::from_floor_formula(MEASURED, 0.3), Err(MirrorError::FloorFormula));
    }

    proptest! {
        /// The path from focus to mirror to lens is as much longer than the straight one for every ray: a hyperbola.
        #[test]
        fn rays_are_reflected_by_a_hyperboloid(radius_px in 0.5..300.0) {
            let mirror = sekimori();
            let out = mirror.direction(radius_px).unwrap();
            let to_mirror = Vector2::new(radius_px, mirror.focal_px).normalize();
            // Where the ray of the lens meets the line through the focus.
            let along = -mirror.viewpoint().perp(&out) / out.perp(&to_mirror);
            let hit = to_mirror * along;
            let difference = hit.norm() - (hit - mirror.viewpoint()).norm();
            prop_assert!((difference - mirror.foci_m / mirror.eccentricity).abs() < 1e-12);
        }

        #[test]
        fn formula_and_mirror_agree(radius_px in 0.0..113.7) {
            let mirror = sekimori();
            let formula = mirror.floor_formula(0.165);
            let direction = mirror.direction(radius_px).unwrap();
            let r = formula.floor_radius_m(radius_px).unwrap();
            let height = 0.165 + mirror.foci_m;
            prop_assert!((r - height * direction.x / -direction.y).abs() < 1e-9 * (1.0 + r * r));
            prop_assert!((formula.radius_px(r) - radius_px).abs() < 1e-9);
            let slope = mirror.nadir_slope(radius_px) * (height + r * r / height);
            prop_assert!((formula.slope_m_per_px(radius_px).unwrap() - slope).abs() < 1e-9 * slope.max(1.0) * (1.0 + r));
        }
    }
}
