//! The pinhole camera with Brown-Conrady distortion.

use nalgebra::{Matrix2, Matrix3, Point3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_inline_default::serde_inline_default;
use thiserror::Error;

use super::is_in_image;

/// Minimum depth of a projected point along the optical axis, m.
pub const NEAR_PLANE_M: f64 = 0.1;

/// Maximum residual of the undistortion, normalized image units.
const UNDISTORTION_TOLERANCE: f64 = 1e-14;
const UNDISTORTION_STEPS: usize = 60;

/// Intrinsic parameters without distortion, and the image size; pixels, with pixel centers on integers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Column of the principal point, pixels.
    pub cx: f64,
    /// Row of the principal point, pixels.
    pub cy: f64,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
}

impl Intrinsics {
    /// Returns columns and rows of the image.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Creates intrinsics with square pixels and a centered principal point from the horizontal field of view (rad, in
    /// (0, pi)) across the whole width: `fx = (width/2) / tan(fov/2)`.
    #[must_use]
    pub fn from_horizontal_fov(width: u32, height: u32, fov_rad: f64) -> Self {
        let focal = 0.5 * f64::from(width) / (0.5 * fov_rad).tan();
        Self {
            fx: focal,
            fy: focal,
            cx: 0.5 * (f64::from(width) - 1.0),
            cy: 0.5 * (f64::from(height) - 1.0),
            width,
            height,
        }
    }

    /// Returns the horizontal field of view across the whole width, rad.
    #[must_use]
    pub fn horizontal_fov(&self) -> f64 {
        2.0 * (0.5 * f64::from(self.width) / self.fx).atan()
    }

    /// Returns the matrix K, which maps a point of the plane z = 1 to its undistorted pixel.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// Returns the normalized coordinates ((u - cx)/fx, (v - cy)/fy) of an undistorted pixel.
    #[must_use]
    pub fn normalized_from_pixel(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy)
    }

    /// Returns the undistorted pixel of normalized coordinates.
    #[must_use]
    pub fn pixel_from_normalized(&self, normalized: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * normalized.x + self.cx, self.fy * normalized.y + self.cy)
    }

    /// Returns true if the pixel lies in the image: within [-0.5, width - 0.5) and [-0.5, height - 0.5).
    #[must_use]
    pub fn contains(&self, pixel: Vector2<f64>) -> bool {
        is_in_image(pixel, [self.width, self.height])
    }

    /// Returns true for finite numbers, positive focal lengths and an image of at least one pixel.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        [self.fx, self.fy, self.cx, self.cy].iter().all(|value| value.is_finite())
            && self.fx > 0.0
            && self.fy > 0.0
            && self.width > 0
            && self.height > 0
    }
}

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
    fn valid_radius_squared(&self) -> f64 {
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

/// A pinhole camera as a robot file writes it: image size, field of view in degrees or focal lengths in pixels, and the
/// distortion.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntrinsicsConfig {
    /// Image width, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub width: u32,
    /// Image height, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub height: u32,
    /// Horizontal field of view, which gives a focal length that is not set.
    #[serde_inline_default(60.0)]
    #[schemars(range(min = 5.0, max = 170.0))]
    pub fov_deg: f64,
    /// Horizontal focal length, pixels; without it, from `fov_deg`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1e5))]
    pub fx: Option<f64>,
    /// Vertical focal length, pixels; without it, `fx`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1e5))]
    pub fy: Option<f64>,
    /// Column of the principal point, pixels; without it, (width - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cx: Option<f64>,
    /// Row of the principal point, pixels; without it, (height - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cy: Option<f64>,
    /// Brown-Conrady coefficients.
    #[serde(default)]
    pub distortion: Distortion,
}

impl IntrinsicsConfig {
    /// Returns the intrinsics.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        let from_fov = Intrinsics::from_horizontal_fov(self.width, self.height, self.fov_deg.to_radians());
        let fx = self.fx.unwrap_or(from_fov.fx);
        Intrinsics {
            fx,
            fy: self.fy.unwrap_or(fx),
            cx: self.cx.unwrap_or(from_fov.cx),
            cy: self.cy.unwrap_or(from_fov.cy),
            ..from_fov
        }
    }

    /// The whole camera.
    #[must_use]
    pub fn pinhole(&self) -> Pinhole {
        Pinhole::new(self.intrinsics(), self.distortion)
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
    fn field_of_view_gives_the_focal_length() {
        let intrinsics = vga();
        assert!((intrinsics.fx - 554.256_258_422_040_8).abs() < 1e-9);
        assert_eq!((intrinsics.cx, intrinsics.cy), (319.5, 239.5));
        assert!((intrinsics.horizontal_fov().to_degrees() - 60.0).abs() < 1e-12);
        let config: IntrinsicsConfig = toml::from_str("width = 640\nheight = 480\nfov_deg = 60.0").unwrap();
        assert_eq!(config.intrinsics(), intrinsics);
        assert!(toml::from_str::<IntrinsicsConfig>("width = 640\nheight = 480\nfov = 60.0").is_err());
    }

    #[test]
    fn every_number_of_a_camera_has_a_range() {
        let schema = schemars::schema_for!(IntrinsicsConfig).to_value();
        let distortion = &schema["$defs"]["Distortion"];
        for properties in [&schema["properties"], &distortion["properties"]] {
            for (key, part) in properties.as_object().unwrap().iter().filter(|(key, _)| *key != "distortion")
            {
                assert!(part["minimum"].is_number() && part["maximum"].is_number(), "{key}: {part}");
            }
        }
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
