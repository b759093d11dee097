//! The conic mirror above a camera that looks straight up; each azimuth has its own viewpoint.

use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mirror_camera::{Meridian, MirrorError};
use crate::Hypotenuse;

/// A cone coaxial with the camera, with its tip pointing down at the lens.
///
/// Its rays do not meet in one point. Those in the half-plane of one azimuth meet in the mirror image of the lens,
/// which lies on the other side of the axis; the viewpoints of all azimuths form a horizontal circle.
///
/// Yagi, Nishizawa & Yachida (1995), section II. Differs from it: the camera looks up and the tip points down, and the
/// viewpoints are exact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConicMirror {
    /// Full angle of the cone at its tip, rad, in (pi/2, pi).
    vertex_angle: f64,
    /// Height of the tip above the lens center, m.
    lens_to_vertex_m: f64,
    /// Focal length, pixels of the mirror plane.
    focal_px: f64,
    sin: f64,
    cos: f64,
}

impl ConicMirror {
    /// Creates a cone from its full vertex angle (rad, in (pi/2, pi)), the height of its tip above the lens (m) and the
    /// camera's focal length (pixels).
    ///
    /// # Errors
    /// [`MirrorError::Shape`] outside these ranges.
    pub fn new(vertex_angle_rad: f64, lens_to_vertex_m: f64, focal_px: f64) -> Result<Self, MirrorError> {
        let (sin, cos) = vertex_angle_rad.sin_cos();
        let usable =
            sin > 0.0 && cos < 0.0 && [lens_to_vertex_m, focal_px].iter().all(|v| *v > 0.0 && v.is_finite());
        usable.then_some(Self { vertex_angle: vertex_angle_rad, lens_to_vertex_m, focal_px, sin, cos }).ok_or(
            MirrorError::Shape("the vertex angle must lie between 90 and 180 degrees, and lengths above 0"),
        )
    }

    /// Returns the image radius of the horizon, pixels.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.focal_px * -self.cos / self.sin
    }

    /// Returns the reflection point of an image radius: distance from the axis and height above the lens, m.
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
        // A ray that leaves the lens at eta from straight up is reflected to vertex angle - eta.
        let hypotenuse = radius_px.hypotenuse(self.focal_px);
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
    /// Full angle of the cone at its tip.
    #[schemars(range(min = 91.0, max = 179.0))]
    pub vertex_angle_deg: f64,
    /// Height of the tip above the lens center.
    #[schemars(range(min = 0.001, max = 5.0))]
    pub lens_to_vertex_m: f64,
    /// Focal length.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub focal_px: f64,
}

impl ConicMirrorConfig {
    /// The checked mirror.
    ///
    /// # Errors
    /// Same as [`ConicMirror::new`].
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
    fn invalid_cones_are_refused() {
        for (angle, l, f) in [(1.5, 0.1, 500.0), (3.2, 0.1, 500.0), (2.0, 0.0, 500.0), (2.0, 0.1, f64::NAN)] {
            assert!(matches!(ConicMirror::new(angle, l, f), Err(MirrorError::Shape(_))), "{angle} {l} {f}");
        }
    }

    proptest! {
        /// The normal of the cone bisects the angle between the directions to the lens and to the world, and the ray
        /// passes through the viewpoint.
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
