//! Distance to a wall from the image of its floor line, exactly, for any heading, tilt and roll.
//!
//! Kweon et al. (1991), section 3.2. Differs from \[1\]: their formula holds for heading and tilt zero; these are exact.

use nalgebra::{Matrix2, Matrix3, Point2, RowVector4, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::Intrinsics;

use crate::corridor::heading::CameraAttitude;

/// A line whose plane leans away from the corridor's axis by more than this (rad) is not one of its walls.
pub const LARGEST_SKEW_RAD: f64 = 0.0349;
/// Below this part of the plane's normal pointing across, the line is at the horizon.
const SMALLEST_ACROSS: f64 = 0.02;

/// The camera as the corridor sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorView {
    /// Rotation from the optical frame to the corridor's frame (x along, y left, z up).
    pub corridor_from_camera: Matrix3<f64>,
    /// Height of the optical center above the floor, meters.
    pub height_m: f64,
    /// The image geometry, undistorted.
    pub intrinsics: Intrinsics,
}

/// Why a line gives no distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoDistance {
    /// The line does not run along the corridor.
    #[error("the line does not run along the corridor")]
    Skew,
    /// The line lies on the horizon, infinitely far away.
    #[error("the line lies on the horizon")]
    Horizon,
}

impl CorridorView {
    /// The view of a camera with this attitude and roll (rad).
    #[must_use]
    pub fn new(attitude: CameraAttitude, roll: f64, height_m: f64, intrinsics: Intrinsics) -> Self {
        let mount = yamabico_geometry::camera::Mount {
            pan: attitude.heading,
            tilt: attitude.tilt,
            roll,
            ..yamabico_geometry::camera::Mount::level(height_m)
        };
        Self { corridor_from_camera: mount.rotation_body_from_camera(), height_m, intrinsics }
    }

    /// Unit normal, in the corridor's frame, of the plane through the optical center and a pixel line (a, b, c) with
    /// a u + b v + c = 0.
    #[must_use]
    pub fn plane_normal(&self, pixel_line: Vector3<f64>) -> Vector3<f64> {
        self.corridor_from_camera * (self.intrinsics.matrix().transpose() * pixel_line).normalize()
    }

    /// Signed distance (m) from the camera to the wall whose floor line is seen as `pixel_line`; positive on the left.
    ///
    /// # Errors
    /// `Skew` for a line off the corridor's direction by more than [`LARGEST_SKEW_RAD`], `Horizon` for one at infinity.
    pub fn wall_distance(&self, pixel_line: Vector3<f64>) -> Result<f64, NoDistance> {
        let normal = self.plane_normal(pixel_line);
        if normal.x.abs() > LARGEST_SKEW_RAD.sin() || normal.x.is_nan() {
            return Err(NoDistance::Skew);
        }
        if normal.y.abs() <= SMALLEST_ACROSS {
            return Err(NoDistance::Horizon);
        }
        Ok(self.height_m * normal.z / normal.y)
    }

    /// Signed distance (m) to the line along the corridor through the floor point seen at `pixel`: the floor line tied to
    /// the vanishing point that the view was made from. `None` for a pixel at or above the horizon.
    #[must_use]
    pub fn tied_distance(&self, pixel: Vector2<f64>) -> Option<f64> {
        self.floor_point(pixel).map(|point| point.y)
    }

    /// The floor point seen at `pixel`: meters ahead along the corridor and to the left, from the point below the camera.
    /// `None` for a pixel at or above the horizon.
    #[must_use]
    pub fn floor_point(&self, pixel: Vector2<f64>) -> Option<Point2<f64>> {
        let ray = self.corridor_from_camera * self.intrinsics.normalized_from_pixel(pixel).push(1.0);
        (ray.z < -1e-9).then(|| Point2::new(ray.x, ray.y) * (self.height_m / -ray.z))
    }
}

/// The pixel line through two pixels, of unit normal: a^2 + b^2 = 1; NaN for twice the same.
#[must_use]
pub fn line_through(a: Vector2<f64>, b: Vector2<f64>) -> Vector3<f64> {
    let line = a.push(1.0).cross(&b.push(1.0));
    line / line.xy().norm()
}

/// Inverse slope dx/dy of a pixel line in normalized coordinates: finite also for a line that is vertical in the image.
#[must_use]
pub fn inverse_slope(pixel_line: Vector3<f64>, intrinsics: &Intrinsics) -> f64 {
    -(pixel_line.y * intrinsics.fy) / (pixel_line.x * intrinsics.fx)
}

/// Cotangent of the wall's angle: signed distance over camera height, from the inverse slope seen without roll.
#[must_use]
pub fn distance_over_height(inverse_slope: f64, attitude: CameraAttitude) -> f64 {
    let CameraAttitude { heading, tilt } = attitude;
    -(inverse_slope * heading.cos() / tilt.cos() + heading.sin() * tilt.tan())
}

/// Signed distance (m) from the inverse slope; positive on the left; a camera without roll.
#[must_use]
pub fn distance_from_slope(inverse_slope: f64, attitude: CameraAttitude, height_m: f64) -> f64 {
    height_m * distance_over_height(inverse_slope, attitude)
}

/// Width of the corridor (m) from the inverse slopes of its two floor lines; a camera without roll.
#[must_use]
pub fn width_from_slopes(left: f64, right: f64, attitude: CameraAttitude, height_m: f64) -> f64 {
    height_m * (right - left) * attitude.heading.cos() / attitude.tilt.cos()
}

/// Height of the camera (m) from a corridor of known width; infinite for equal slopes.
#[must_use]
pub fn height_from_width(left: f64, right: f64, attitude: CameraAttitude, width_m: f64) -> f64 {
    width_m * attitude.tilt.cos() / ((right - left) * attitude.heading.cos())
}

/// Derivatives of the distance with respect to (inverse slope, heading, tilt, height), each taken as independent.
#[must_use]
pub fn distance_gradient(inverse_slope: f64, attitude: CameraAttitude, height_m: f64) -> RowVector4<f64> {
    let ((sin_h, cos_h), (sin_t, cos_t)) = (attitude.heading.sin_cos(), attitude.tilt.sin_cos());
    let (s, h) = (inverse_slope, height_m);
    RowVector4::new(
        -h * cos_h / cos_t,
        h * (s * sin_h / cos_t - cos_h * sin_t / cos_t),
        -h * (s * cos_h * sin_t + sin_h) / (cos_t * cos_t),
        distance_over_height(s, attitude),
    )
}

/// Standard deviation (m) of [`CorridorView::tied_distance`] through `far_point`, from the covariance of the vanishing
/// point (px^2) and of the point across its line (px), by central differences; a camera with this roll (rad). `None` where
/// a difference has no floor point.
#[must_use]
pub fn tied_distance_sigma(
    vanishing_point: Vector2<f64>,
    covariance: &Matrix2<f64>,
    far_point: Vector2<f64>,
    point_sigma_px: f64,
    view: &CorridorView,
    roll: f64,
) -> Option<f64> {
    const STEP_PX: f64 = 0.25;
    let distance = |vp: Vector2<f64>, point: Vector2<f64>| {
        let attitude = CameraAttitude::from_vanishing_point(view.intrinsics.normalized_from_pixel(vp), roll);
        CorridorView::new(attitude, roll, view.height_m, view.intrinsics).tied_distance(point)
    };
    let slope = |step_vp: Vector2<f64>, step_point: Vector2<f64>| {
        let plus = distance(vanishing_point + step_vp, far_point + step_point)?;
        let minus = distance(vanishing_point - step_vp, far_point - step_point)?;
        Some((plus - minus) / (2.0 * STEP_PX))
    };
    let (across_u, across_v) = (Vector2::new(STEP_PX, 0.0), Vector2::new(0.0, STEP_PX));
    let line = line_through(vanishing_point, far_point);
    let by_vp = Vector2::new(slope(across_u, Vector2::zeros())?, slope(across_v, Vector2::zeros())?);
    let by_point = slope(Vector2::zeros(), line.xy() * STEP_PX)?;
    let sigma = (by_vp.dot(&(covariance * by_vp)) + (by_point * point_sigma_px).powi(2)).sqrt();
    sigma.is_finite().then_some(sigma)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ATTITUDE: CameraAttitude = CameraAttitude { heading: 0.2, tilt: 0.1 };

    fn view(roll: f64) -> CorridorView {
        CorridorView::new(ATTITUDE, roll, 0.6, Intrinsics::from_horizontal_fov(640, 480, 1.05))
    }

    fn pixel(view: &CorridorView, point: Vector3<f64>) -> Vector2<f64> {
        let p = view.intrinsics.matrix() * (view.corridor_from_camera.transpose() * point);
        p.xy() / p.z
    }

    #[test]
    fn plane_slope_and_tied_forms_agree() {
        for d in [-1.3, -0.2, 0.4, 1.0] {
            let view = view(0.0);
            let (a, b) = (pixel(&view, Vector3::new(2.0, d, -0.6)), pixel(&view, Vector3::new(6.0, d, -0.6)));
            let line = line_through(a, b);
            assert!((view.wall_distance(line).unwrap() - d).abs() < 1e-12);
            assert!((view.tied_distance(a).unwrap() - d).abs() < 1e-12);
            let s = inverse_slope(line, &view.intrinsics);
            assert!((distance_from_slope(s, ATTITUDE, 0.6) - d).abs() < 1e-12);
        }
    }

    #[test]
    fn crossing_lines_and_the_horizon_are_named() {
        let view = view(0.03);
        let (a, b) =
            (pixel(&view, Vector3::new(3.0, 0.5, -0.6)), pixel(&view, Vector3::new(3.0, -0.5, -0.6)));
        assert_eq!(view.wall_distance(line_through(a, b)), Err(NoDistance::Skew));
        let (a, b) = (pixel(&view, Vector3::new(3.0, 0.5, 0.0)), pixel(&view, Vector3::new(3.0, -0.5, 0.0)));
        assert_eq!(view.wall_distance(line_through(a, b)), Err(NoDistance::Horizon));
        assert!(view.wall_distance(line_through(a, a)).is_err());
        assert!(view.floor_point(pixel(&view, Vector3::new(3.0, 0.5, 0.4))).is_none());
    }

    #[test]
    fn width_calibrates_the_height() {
        let (left, right) = (-1.4, 2.1);
        let width = width_from_slopes(left, right, ATTITUDE, 0.6);
        assert!((height_from_width(left, right, ATTITUDE, width) - 0.6).abs() < 1e-12);
    }

    #[test]
    fn gradient_matches_differences() {
        let (s, h) = (-1.2, 1e-6);
        let at = |ds: f64, dp: f64, dt: f64, dh: f64| {
            let attitude = CameraAttitude { heading: ATTITUDE.heading + dp, tilt: ATTITUDE.tilt + dt };
            distance_from_slope(s + ds, attitude, 0.6 + dh)
        };
        let differences = RowVector4::new(
            at(h, 0.0, 0.0, 0.0) - at(-h, 0.0, 0.0, 0.0),
            at(0.0, h, 0.0, 0.0) - at(0.0, -h, 0.0, 0.0),
            at(0.0, 0.0, h, 0.0) - at(0.0, 0.0, -h, 0.0),
            at(0.0, 0.0, 0.0, h) - at(0.0, 0.0, 0.0, -h),
        ) / (2.0 * h);
        assert!((differences - distance_gradient(s, ATTITUDE, 0.6)).norm() < 1e-8);
    }

    #[test]
    fn sigma_grows_with_the_point_and_the_vanishing_point() {
        let view = view(0.0);
        let vp = view.intrinsics.pixel_from_normalized(ATTITUDE.vanishing_point());
        let point = pixel(&view, Vector3::new(3.0, 1.0, -0.6));
        let sigma = |vp_px: f64, px: f64| {
            tied_distance_sigma(vp, &(Matrix2::identity() * vp_px * vp_px), point, px, &view, 0.0).unwrap()
        };
        assert!(sigma(1.0, 0.5) > sigma(0.5, 0.5) && sigma(0.5, 1.0) > sigma(0.5, 0.5));
        assert!(sigma(1.0, 0.5) > 0.001 && sigma(1.0, 0.5) < 0.1);
    }
}
