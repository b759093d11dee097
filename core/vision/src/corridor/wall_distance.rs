//! Distance to a wall from its floor line, exact for any heading, tilt and roll.
//!
//! Kweon et al. (1991), section 3.2. Differs from \[1\]: their formula holds for zero heading and tilt.

use nalgebra::{Matrix2, Matrix3, Point2, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::Intrinsics;

use crate::corridor::heading::CameraAttitude;

/// Maximum angle between a wall's interpretation plane and the corridor axis, rad.
pub const MAX_SKEW_RAD: f64 = 0.0349;
/// Minimum lateral component of the interpretation plane's normal. Below it, the line lies on the horizon.
const MIN_ACROSS: f64 = 0.02;

/// Camera orientation and height in the corridor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorView {
    /// Rotation from the optical frame to the corridor frame (x along, y left, z up).
    pub corridor_from_camera: Matrix3<f64>,
    /// Height of the optical center above the floor, m.
    pub height_m: f64,
    /// Intrinsics of the undistorted image.
    pub intrinsics: Intrinsics,
}

/// Reason why a line gives no wall distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum WallDistanceError {
    /// The line is not parallel to the corridor.
    #[error("the line does not run along the corridor")]
    Skew,
    /// The line lies on the horizon, at infinite distance.
    #[error("the line lies on the horizon")]
    Horizon,
}

impl CorridorView {
    /// Creates the view of a camera with this attitude and roll (rad).
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

    /// Unit normal, in the corridor frame, of the interpretation plane of a pixel line (a, b, c) with a u + b v + c =
    /// 0.
    #[must_use]
    pub fn plane_normal(&self, pixel_line: Vector3<f64>) -> Vector3<f64> {
        self.corridor_from_camera * (self.intrinsics.matrix().transpose() * pixel_line).normalize()
    }

    /// Computes the signed distance from the camera to the wall with the floor line `pixel_line`, m, positive to the
    /// left.
    ///
    /// # Errors
    /// `Skew` if the line deviates from the corridor's direction by more than [`MAX_SKEW_RAD`], `Horizon` if it lies at
    /// infinity.
    pub fn wall_distance(&self, pixel_line: Vector3<f64>) -> Result<f64, WallDistanceError> {
        let normal = self.plane_normal(pixel_line);
        if normal.x.abs() > MAX_SKEW_RAD.sin() || normal.x.is_nan() {
            return Err(WallDistanceError::Skew);
        }
        if normal.y.abs() <= MIN_ACROSS {
            return Err(WallDistanceError::Horizon);
        }
        Ok(self.height_m * normal.z / normal.y)
    }

    /// Lateral distance of the floor point at `pixel`, m, positive to the left: that of the line through the pixel and
    /// the vanishing point of this view. `None` for a pixel at or above the horizon.
    #[must_use]
    pub fn lateral_distance(&self, pixel: Vector2<f64>) -> Option<f64> {
        self.floor_point(pixel).map(|point| point.y)
    }

    /// Floor point at `pixel`, m: x ahead along the corridor, y to the left, from the point below the camera. `None`
    /// for a pixel at or above the horizon.
    #[must_use]
    pub fn floor_point(&self, pixel: Vector2<f64>) -> Option<Point2<f64>> {
        let ray = self.corridor_from_camera * self.intrinsics.normalized_from_pixel(pixel).push(1.0);
        (ray.z < -1e-9).then(|| Point2::new(ray.x, ray.y) * (self.height_m / -ray.z))
    }
}

/// Line through two pixels, normalized to a^2 + b^2 = 1. NaN if the pixels coincide.
#[must_use]
pub fn line_through(a: Vector2<f64>, b: Vector2<f64>) -> Vector3<f64> {
    let line = a.push(1.0).cross(&b.push(1.0));
    line / line.xy().norm()
}

/// Inverse slope dx/dy of a pixel line in normalized coordinates, finite for a line that is vertical in the image.
#[must_use]
pub fn inverse_slope(pixel_line: Vector3<f64>, intrinsics: &Intrinsics) -> f64 {
    -(pixel_line.y * intrinsics.fy) / (pixel_line.x * intrinsics.fx)
}

/// Ratio of signed lateral distance to camera height, from the inverse slope for a camera without roll.
#[must_use]
pub fn distance_over_height(inverse_slope: f64, attitude: CameraAttitude) -> f64 {
    let CameraAttitude { heading, tilt } = attitude;
    -(inverse_slope * heading.cos() / tilt.cos() + heading.sin() * tilt.tan())
}

/// Signed lateral distance from the inverse slope, m, positive to the left, for a camera without roll.
#[must_use]
pub fn distance_from_slope(inverse_slope: f64, attitude: CameraAttitude, height_m: f64) -> f64 {
    height_m * distance_over_height(inverse_slope, attitude)
}

/// Width of the corridor from the inverse slopes of both floor lines, m, for a camera without roll.
#[must_use]
pub fn width_from_slopes(left: f64, right: f64, attitude: CameraAttitude, height_m: f64) -> f64 {
    height_m * (right - left) * attitude.heading.cos() / attitude.tilt.cos()
}

/// Standard deviation of [`CorridorView::lateral_distance`] at `far_point`, m, propagated by central differences from
/// the covariance of the vanishing point (px^2) and the noise of the point perpendicular to its line (px), for a camera
/// with this roll (rad). `None` if a perturbed pixel is above the horizon.
#[must_use]
pub fn lateral_distance_sigma(
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
        CorridorView::new(attitude, roll, view.height_m, view.intrinsics).lateral_distance(point)
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
            assert!((view.lateral_distance(a).unwrap() - d).abs() < 1e-12);
            let s = inverse_slope(line, &view.intrinsics);
            assert!((distance_from_slope(s, ATTITUDE, 0.6) - d).abs() < 1e-12);
        }
    }

    #[test]
    fn crossing_lines_and_the_horizon_are_rejected() {
        let view = view(0.03);
        let (a, b) =
            (pixel(&view, Vector3::new(3.0, 0.5, -0.6)), pixel(&view, Vector3::new(3.0, -0.5, -0.6)));
        assert_eq!(view.wall_distance(line_through(a, b)), Err(WallDistanceError::Skew));
        let (a, b) = (pixel(&view, Vector3::new(3.0, 0.5, 0.0)), pixel(&view, Vector3::new(3.0, -0.5, 0.0)));
        assert_eq!(view.wall_distance(line_through(a, b)), Err(WallDistanceError::Horizon));
        assert!(view.wall_distance(line_through(a, a)).is_err());
        assert!(view.floor_point(pixel(&view, Vector3::new(3.0, 0.5, 0.4))).is_none());
    }

    #[test]
    fn sigma_grows_with_the_point_and_the_vanishing_point() {
        let view = view(0.0);
        let vp = view.intrinsics.pixel_from_normalized(ATTITUDE.vanishing_point());
        let point = pixel(&view, Vector3::new(3.0, 1.0, -0.6));
        let sigma = |vp_px: f64, px: f64| {
            lateral_distance_sigma(vp, &(Matrix2::identity() * vp_px * vp_px), point, px, &view, 0.0).unwrap()
        };
        assert!(sigma(1.0, 0.5) > sigma(0.5, 0.5) && sigma(0.5, 1.0) > sigma(0.5, 0.5));
        assert!(sigma(1.0, 0.5) > 0.001 && sigma(1.0, 0.5) < 0.1);
    }
}
