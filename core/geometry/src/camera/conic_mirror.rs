//! The conic mirror above a camera that looks straight up: every azimuth has a viewpoint of its own.

use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mirror_camera::{Meridian, MirrorError};

/// A cone whose tip points down at the lens, coaxial with the camera.
///
/// Its rays do not meet in one point. In the half-plane of each azimuth they meet in the mirror image of the lens, which
/// lies beyond the axis; turned through all azimuths it is a horizontal circle of viewpoints.
///
/// Yagi, Nishizawa & Yachida (1995), section II. Differs from it: the camera looks up and the tip points down, and
/// the viewpoints are exact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConicMirror {
    /// Full angle of the cone at its tip, radians, in (pi/2, pi).
    vertex_angle: f64,
    /// From the lens center up to the tip, meters.
    lens_to_vertex_m: f64,
    /// Focal length, pixels of the mirror plane.
    focal_px: f64,
    sin: f64,
    cos: f64,
}

impl ConicMirror {
    /// A cone of this full vertex angle (rad, in (pi/2, pi)), this far above the lens, seen with this focal length.
    ///
    /// # Errors
    /// [`MirrorError::Shape`] outside these ranges.
    pub fn new(vertex_angle_rad: f64, lens_to_vertex_m: f64, focal_px: f64) -> Result<Self, MirrorError> {
        let (sin, cos) = vertex_angle_rad.sin_cos();
        let usable =
            sin > 0.0 && cos < 0.0 && [lens_to_vertex_m, focal_px].iter().all(|v| *v > 0.0 && v.is_finite());
        usable.then_some(Self { vertex_angle: vertex_angle_rad, lens_to_vertex_m, focal_px, sin, cos }).ok_or(
            MirrorError::Shape("the vertex angle lies between 90 and 180 degrees, lengths are above 0"),
        )
    }

    /// Full angle at the tip, radians: also the view angle from straight up that the center of the image shows.
    #[must_use]
    pub fn vertex_angle(&self) -> f64 {
        self.vertex_angle
    }

    /// Distance from the axis (pixels) at which the horizon is seen.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.focal_px * -self.cos / self.sin
    }

    /// Where the ray of an image radius leaves the mirror: distance from the axis and height above the lens, meters.
    #[must_use]
    pub fn reflection_point(&self, radius_px: f64) -> Vector2<f64> {
        let eta = radius_px.atan2(self.focal_px);
        let half = 0.5 * self.vertex_angle;
        self.lens_to_vertex_m * half.sin() / (half - eta).sin() * Vector2::new(eta.sin(), eta.cos())
    }
}

impl Meridian for ConicMirror {
    fn viewpoint(&self) -> Vector2<f64> {
        self.lens_to_vertex_m * Vector2::new(-self.sin, 1.0 - self.cos)
    }

    fn direction(&self, radius_px: f64) -> Option<Vector2<f64>> {
        // The lens sees the mirror at eta from straight up; the world lies at vertex angle - eta.
        let hypotenuse = radius_px.hypot(self.focal_px);
        let (cos, sin) = (self.focal_px / hypotenuse, radius_px / hypotenuse);
        let inside = radius_px >= 0.0 && radius_px.atan2(self.focal_px) < 0.5 * self.vertex_angle;
        inside.then(|| Vector2::new(self.sin * cos - self.cos * sin, self.cos * cos + self.sin * sin))
    }

    fn radius_px(&self, direction: Vector2<f64>) -> Option<f64> {
        let cos = self.cos * direction.y + self.sin * direction.x;
        let sin = self.sin * direction.y - self.cos * direction.x;
        (sin >= 0.0 && cos > 0.0).then(|| self.focal_px * sin / cos)
    }

    fn nadir_slope(&self, radius_px: f64) -> f64 {
        self.focal_px / (self.focal_px * self.focal_px + radius_px * radius_px)
    }
}

/// A [`ConicMirror`] as a robot file writes it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConicMirrorConfig {
    /// Full angle of the cone at its tip, degrees, 91 to 179.
    #[schemars(range(min = 91.0, max = 179.0))]
    pub vertex_angle_deg: f64,
    /// From the lens center up to the tip, m, 0.001 to 5.
    #[schemars(range(min = 0.001, max = 5.0))]
    pub lens_to_vertex_m: f64,
    /// Focal length, pixels, 1 to 100000.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub focal_px: f64,
}

impl ConicMirrorConfig {
    /// The checked mirror.
    ///
    /// # Errors
    /// As [`ConicMirror::new`].
    pub fn mirror(&self) -> Result<ConicMirror, MirrorError> {
        ConicMirror::new(self.vertex_angle_deg.to_radians(), self.lens_to_vertex_m, self.focal_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn copis() -> ConicMirror {
        let angle = 112.6_f64.to_radians();
        ConicMirror::new(angle, 0.11, 240.0 / (angle - std::f64::consts::FRAC_PI_2).tan()).unwrap()
    }

    #[test]
    fn the_horizon_is_at_the_rim_and_the_circle_of_viewpoints_a_decimeter_behind() {
        let mirror = copis();
        assert!((mirror.horizon_px() - 240.0).abs() < 1e-9);
        assert!(mirror.direction(240.0).unwrap().y.abs() < 1e-12);
        assert!((mirror.viewpoint() - Vector2::new(-0.101_553, 0.152_272)).norm() < 1e-6);
    }

    #[test]
    fn shapes_that_are_no_cone_above_a_camera_are_refused() {
        for (angle, l, f) in [(1.5, 0.1, 500.0), (3.2, 0.1, 500.0), (2.0, 0.0, 500.0), (2.0, 0.1, f64::NAN)] {
            assert!(matches!(ConicMirror::new(angle, l, f), Err(MirrorError::Shape(_))), "{angle} {l} {f}");
        }
    }

    proptest! {
        /// The normal of the cone halves the angle between the ways to the lens and to the world, and the ray comes from the
        /// viewpoint.
        #[test]
        fn the_law_of_reflection_holds(radius_px in 0.0..400.0, angle in 1.7..2.6, l in 0.02..0.5) {
            let mirror = ConicMirror::new(angle, l, 576.0).unwrap();
            prop_assume!(mirror.direction(radius_px).is_some());
            let (hit, out) = (mirror.reflection_point(radius_px), mirror.direction(radius_px).unwrap());
            let half = 0.5 * angle;
            let normal = Vector2::new(half.cos(), -half.sin());
            let to_lens = -hit.normalize();
            prop_assert!((to_lens.dot(&normal) - out.dot(&normal)).abs() < 1e-12);
            prop_assert!((to_lens + out - normal * (2.0 * out.dot(&normal))).norm() < 1e-12);
            let from_viewpoint = hit - mirror.viewpoint();
            prop_assert!(from_viewpoint.perp(&out).abs() < 1e-12 && from_viewpoint.dot(&out) > 0.0);
        }
    }
}
