//! The pinhole camera with Brown-Conrady distortion.

use nalgebra::{Point3, Vector2, Vector3};
use thiserror::Error;

use super::distortion::Distortion;
use super::intrinsics::Intrinsics;
use super::mount::Mount;

/// Minimum depth of a projected point along the optical axis, m.
pub const NEAR_PLANE_M: f64 = 0.1;

/// Maximum residual of the undistortion, normalized image units.
const UNDISTORTION_TOLERANCE: f64 = 1e-14;
const UNDISTORTION_STEPS: usize = 60;

/// Reason why a point cannot be projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ProjectionError {
    /// The point lies behind the near plane.
    #[error("the point is behind the near plane")]
    BehindNearPlane,
    /// The ray leaves the range in which the distortion polynomial can be inverted.
    #[error("the ray is outside the lens model")]
    OutsideLens,
}

/// A pinhole camera: intrinsics and distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    intrinsics: Intrinsics,
    distortion: Distortion,
    valid_radius_squared: f64,
}

impl Pinhole {
    /// Creates a camera with distortion.
    #[must_use]
    pub fn new(intrinsics: Intrinsics, distortion: Distortion) -> Self {
        Self { intrinsics, distortion, valid_radius_squared: distortion.valid_radius_squared() }
    }

    /// Creates a camera without distortion.
    #[must_use]
    pub fn ideal(intrinsics: Intrinsics) -> Self {
        Self::new(intrinsics, Distortion::NONE)
    }

    /// Returns the intrinsics.
    #[must_use]
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Returns the distortion.
    #[must_use]
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Projects a point in the optical frame to its distorted pixel, which may lie outside the image.
    ///
    /// # Errors
    /// [`ProjectionError::BehindNearPlane`] for z < [`NEAR_PLANE_M`], [`ProjectionError::OutsideLens`] outside of the
    /// radius where the distortion is monotonic.
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Result<Vector2<f64>, ProjectionError> {
        if point_in_camera.z.is_nan() || point_in_camera.z < NEAR_PLANE_M {
            return Err(ProjectionError::BehindNearPlane);
        }
        let ideal = point_in_camera.xy().coords / point_in_camera.z;
        if !self.is_invertible_at(ideal) {
            return Err(ProjectionError::OutsideLens);
        }
        Ok(self.intrinsics.pixel_from_normalized(self.distortion.distort(ideal)))
    }

    /// Returns the ideal normalized coordinates (z = 1) of a distorted pixel, by Newton's method, or `None` if the lens
    /// model cannot be inverted there.
    #[must_use]
    pub fn normalized_from_pixel(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let distorted = self.intrinsics.normalized_from_pixel(pixel);
        if self.distortion == Distortion::NONE {
            return Some(distorted);
        }
        let mut ideal = distorted;
        for _ in 0..UNDISTORTION_STEPS {
            let residual = self.distortion.distort(ideal) - distorted;
            if residual.norm() <= UNDISTORTION_TOLERANCE * (1.0 + distorted.norm()) {
                return self.is_invertible_at(ideal).then_some(ideal);
            }
            let mut step = self.distortion.jacobian(ideal).try_inverse()? * residual;
            let longest = 0.25 * (1.0 + ideal.norm());
            if step.norm() > longest {
                step *= longest / step.norm();
            }
            ideal -= step;
        }
        let residual = (self.distortion.distort(ideal) - distorted).norm();
        (residual < 1e-12 && self.is_invertible_at(ideal)).then_some(ideal)
    }

    /// Returns the unit ray through a pixel in the optical frame, or `None` if the lens model cannot be inverted there.
    #[must_use]
    pub fn ray_from_pixel(&self, pixel: Vector2<f64>) -> Option<Vector3<f64>> {
        self.normalized_from_pixel(pixel).map(|ideal| ideal.push(1.0).normalize())
    }

    /// Returns the pixel at which a camera without distortion would observe the same ray, or `None` if the lens model
    /// cannot be inverted there.
    #[must_use]
    pub fn undistort_pixel(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        self.normalized_from_pixel(pixel).map(|ideal| self.intrinsics.pixel_from_normalized(ideal))
    }

    /// Returns the pixel at which this camera observes the ray of an undistorted pixel, or `None` outside of the lens model.
    #[must_use]
    pub fn distort_pixel(&self, undistorted: Vector2<f64>) -> Option<Vector2<f64>> {
        let ideal = self.intrinsics.normalized_from_pixel(undistorted);
        self.project(&Point3::new(ideal.x, ideal.y, 1.0)).ok()
    }

    /// Returns the distorted pixel of a point in the body frame, m, seen from `mount`; `None` if it is behind the camera or
    /// outside of the lens model.
    #[must_use]
    pub fn project_from_body(&self, mount: &Mount, point_in_body: &Point3<f64>) -> Option<Vector2<f64>> {
        self.project(&mount.body_from_camera().inverse_transform_point(point_in_body)).ok()
    }

    fn is_invertible_at(&self, ideal: Vector2<f64>) -> bool {
        ideal.norm_squared() < self.valid_radius_squared
            && self.distortion.jacobian(ideal).determinant() > 0.0
    }
}

/// Clips a segment in the optical frame to the near plane; `None` if all of it lies behind.
#[must_use]
pub fn clip_to_near_plane(start: Point3<f64>, end: Point3<f64>) -> Option<(Point3<f64>, Point3<f64>)> {
    let crossing = |t: f64| {
        let mut point = start + (end - start) * t;
        point.z = NEAR_PLANE_M;
        point
    };
    let t = (NEAR_PLANE_M - start.z) / (end.z - start.z);
    match (start.z >= NEAR_PLANE_M, end.z >= NEAR_PLANE_M) {
        (true, true) => Some((start, end)),
        (true, false) => Some((start, crossing(t))),
        (false, true) => Some((crossing(t), end)),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vga() -> Intrinsics {
        Intrinsics::from_horizontal_fov(640, 480, 60.0_f64.to_radians())
    }

    #[test]
    fn right_and_down_grow_and_behind_is_named() {
        let camera = Pinhole::ideal(vga());
        let pixel = camera.project(&Point3::new(1.0, 0.5, 2.0)).unwrap();
        assert!(pixel.x > 319.5 && pixel.y > 239.5);
        for z in [0.0, -1.0, 0.099, f64::NAN] {
            assert_eq!(camera.project(&Point3::new(0.0, 0.0, z)), Err(ProjectionError::BehindNearPlane));
        }
    }

    #[test]
    fn folding_lens_is_refused() {
        let lens = Distortion { k1: -0.5, ..Distortion::NONE };
        assert!((lens.valid_radius_squared() - 1.0 / 1.5).abs() < 1e-9);
        let camera = Pinhole::new(vga(), lens);
        assert_eq!(camera.project(&Point3::new(0.9, 0.0, 1.0)), Err(ProjectionError::OutsideLens));
        assert!(camera.normalized_from_pixel(Vector2::new(5_000.0, 240.0)).is_none());
    }

    #[test]
    fn near_plane_cuts_segments() {
        let (a, b) = (Point3::new(0.0, 0.0, -1.0), Point3::new(0.0, 2.2, 1.2));
        let (start, end) = clip_to_near_plane(a, b).unwrap();
        assert!((start - Point3::new(0.0, 1.1, NEAR_PLANE_M)).norm() < 1e-12);
        assert_eq!(end, b);
        assert!((clip_to_near_plane(b, a).unwrap().1 - start).norm() < 1e-12);
        assert!(clip_to_near_plane(a, a).is_none());
    }

    proptest! {
        #[test]
        fn pixel_ray_pixel(
            u in 0.0..639.0, v in 0.0..479.0, k1 in -0.3..0.3, k2 in -0.05..0.1, k3 in -0.01..0.02,
            p1 in -0.005..0.005, p2 in -0.005..0.005,
        ) {
            let camera = Pinhole::new(vga(), Distortion { k1, k2, p1, p2, k3 });
            let pixel = Vector2::new(u, v);
            if let Some(ray) = camera.ray_from_pixel(pixel) {
                let back = camera.project(&Point3::from(ray * 3.0));
                prop_assert!((back.unwrap() - pixel).norm() < 1e-9);
            }
            prop_assert!(k1 < 0.0 || k2 < 0.0 || k3 < 0.0 || camera.ray_from_pixel(pixel).is_some());
        }

        #[test]
        fn point_pixel_ray(x in -0.55..0.55, y in -0.4..0.4, k1 in -0.3..0.3, p1 in -0.005..0.005, p2 in -0.005..0.005) {
            let camera = Pinhole::new(vga(), Distortion { k1, p1, p2, ..Distortion::NONE });
            let pixel = camera.project(&Point3::new(x * 4.0, y * 4.0, 4.0)).unwrap();
            let ideal = camera.normalized_from_pixel(pixel).unwrap();
            prop_assert!((ideal - Vector2::new(x, y)).norm() * 554.0 < 1e-9);
        }

        #[test]
        fn jacobian_matches_differences(x in -0.6..0.6, y in -0.6..0.6, k1 in -0.3..0.3, p1 in -0.01..0.01, p2 in -0.01..0.01) {
            let lens = Distortion { k1, p1, p2, k2: 0.05, k3: 0.01 };
            let (at, h) = (Vector2::new(x, y), 1e-6);
            for (column, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].into_iter().enumerate() {
                let difference = (lens.distort(at + step) - lens.distort(at - step)) / (2.0 * h);
                prop_assert!((difference - lens.jacobian(at).column(column)).norm() < 1e-8);
            }
        }
    }
}
