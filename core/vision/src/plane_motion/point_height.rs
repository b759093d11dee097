//! Place and height of a static point from several pictures, with its covariance.

use nalgebra::{Matrix3, Point3, SMatrix, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::{Hypotenuse, Pose2};

use super::floor_view::{FloorView, turn};

const STEP: f64 = 1e-13;
const MAX_ROUNDS: usize = 50;

/// A point in one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Robot at the picture, in the reference robot frame.
    pub robot: Pose2,
    /// Pixel of the undistorted picture.
    pub pixel: Vector2<f64>,
    /// Unit normal of an edge, which tells the position across it alone; `None` for a corner.
    pub normal: Option<Vector2<f64>>,
    /// Covariance of `robot`: x, y (m), theta (rad).
    pub covariance: Matrix3<f64>,
}

/// A static point, in the reference robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointFit {
    /// Bearing from the camera (rad, positive to the left), horizontal distance from the camera (m), height above the
    /// floor (m).
    pub values: Vector3<f64>,
    /// Covariance of `values` from the noise of the pixels.
    pub pixel_covariance: Matrix3<f64>,
    /// Covariance of `values` from motion and mount. Shared by all points of the same pictures: it does not average
    /// out.
    pub common_covariance: Matrix3<f64>,
    /// Derivative of `values` by mount tilt and roll (rad) and camera height (m).
    pub mount_sensitivity: Matrix3<f64>,
}

impl PointFit {
    /// Covariance of the values.
    #[must_use]
    pub fn covariance(&self) -> Matrix3<f64> {
        self.pixel_covariance + self.common_covariance
    }
}

/// Reason why a point has no height.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PointHeightError {
    /// All pictures see the point under the same ray.
    #[error("the pictures see the point without parallax")]
    NoParallax,
    /// The fit left the cameras' view.
    #[error("the point lies behind a camera")]
    Behind,
    /// The fit does not converge.
    #[error("the fit of a point does not converge")]
    Diverged,
}

/// Point closest to all rays, in the reference robot frame, m.
///
/// # Errors
/// [`PointHeightError::NoParallax`].
pub fn linear_point(view: &FloorView, sightings: &[Sighting]) -> Result<Point3<f64>, PointHeightError> {
    let (mut sum, mut offset) = (Matrix3::zeros(), Vector3::zeros());
    for sighting in sightings {
        let turn = turn(sighting.robot.theta);
        let ray = (turn * view.ray(sighting.pixel)).normalize();
        let across = Matrix3::identity() - ray * ray.transpose();
        let camera = turn * view.position() + Vector3::new(sighting.robot.x, sighting.robot.y, 0.0);
        sum += across;
        offset += across * camera;
    }
    let inverse = sum.try_inverse().ok_or(PointHeightError::NoParallax)?;
    Ok(Point3::from(inverse * offset))
}

/// Fits a point to its sightings with the noise `sigma_px`, starting at [`linear_point`]. `mount_covariance` is that of
/// tilt, roll (rad) and camera height (m).
///
/// # Errors
/// [`PointHeightError`].
pub fn fit_point(
    view: &FloorView,
    sightings: &[Sighting],
    sigma_px: f64,
    mount_covariance: &Matrix3<f64>,
) -> Result<PointFit, PointHeightError> {
    let start = linear_point(view, sightings)?;
    let from_camera = start.coords - view.position();
    let mut values =
        Vector3::new(from_camera.y.atan2(from_camera.x), from_camera.x.hypotenuse(from_camera.y), start.z);
    for _ in 0..MAX_ROUNDS {
        let (mut normal, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
        for sighting in sightings {
            let Sensitivity { residual, by_values, .. } = sensitivity(view, sighting, &values)?;
            normal += by_values.transpose() * by_values;
            gradient += by_values.transpose() * residual;
        }
        let inverse = normal.try_inverse().ok_or(PointHeightError::NoParallax)?;
        let step = inverse * gradient;
        values += step;
        if step.amax() < STEP {
            return with_covariance(view, sightings, sigma_px, mount_covariance, values);
        }
    }
    Err(PointHeightError::Diverged)
}

fn with_covariance(
    view: &FloorView,
    sightings: &[Sighting],
    sigma_px: f64,
    mount_covariance: &Matrix3<f64>,
    values: Vector3<f64>,
) -> Result<PointFit, PointHeightError> {
    let mut normal = Matrix3::zeros();
    for sighting in sightings {
        let by_values = sensitivity(view, sighting, &values)?.by_values;
        normal += by_values.transpose() * by_values;
    }
    let inverse = normal.try_inverse().ok_or(PointHeightError::NoParallax)?;
    let (mut common, mut mount_sensitivity) = (Matrix3::zeros(), Matrix3::zeros());
    for sighting in sightings {
        let Sensitivity { by_values, by_pose, by_mount, .. } = sensitivity(view, sighting, &values)?;
        let gain = -(inverse * by_values.transpose());
        let by_pose = gain * by_pose;
        common += by_pose * sighting.covariance * by_pose.transpose();
        mount_sensitivity += gain * by_mount;
    }
    common += mount_sensitivity * mount_covariance * mount_sensitivity.transpose();
    Ok(PointFit {
        values,
        pixel_covariance: inverse * (sigma_px * sigma_px),
        common_covariance: common,
        mount_sensitivity,
    })
}

/// Residual of a sighting (px) and the derivatives of its predicted pixel.
struct Sensitivity {
    residual: Vector2<f64>,
    by_values: SMatrix<f64, 2, 3>,
    by_pose: SMatrix<f64, 2, 3>,
    by_mount: SMatrix<f64, 2, 3>,
}

fn sensitivity(
    view: &FloorView,
    sighting: &Sighting,
    values: &Vector3<f64>,
) -> Result<Sensitivity, PointHeightError> {
    let (sin, cos) = values.x.sin_cos();
    let distance = values.y;
    let camera = view.position();
    let point = Vector3::new(camera.x + distance * cos, camera.y + distance * sin, values.z);
    let back = turn(-sighting.robot.theta);
    let in_robot = back * (point - Vector3::new(sighting.robot.x, sighting.robot.y, 0.0));
    let from_camera = in_robot - camera;
    let in_camera = view.camera_from_robot(&in_robot);
    let pixel = view.project(&in_camera).ok_or(PointHeightError::Behind)?;
    let slope = view.projection_slope(&in_camera) * view.robot_from_camera().transpose();
    // An edge counts only across.
    let across = sighting.normal.map_or(nalgebra::Matrix2::identity(), |normal| normal * normal.transpose());
    let slope = across * slope;
    let by_point = slope * back;
    let in_plane = Matrix3::from_columns(&[
        Vector3::new(-distance * sin, distance * cos, 0.0),
        Vector3::new(cos, sin, 0.0),
        Vector3::z(),
    ]);
    let by_turn = -(slope * Vector3::z().cross(&in_robot));
    let [tilt, roll] = view.tilt_and_roll_axes().map(|axis| -(slope * axis.cross(&from_camera)));
    Ok(Sensitivity {
        residual: across * (sighting.pixel - pixel),
        by_values: by_point * in_plane,
        by_pose: SMatrix::<f64, 2, 3>::from_columns(&[
            -by_point.column(0).into_owned(),
            -by_point.column(1).into_owned(),
            by_turn,
        ]),
        by_mount: SMatrix::<f64, 2, 3>::from_columns(&[tilt, roll, -slope.column(2).into_owned()]),
    })
}
