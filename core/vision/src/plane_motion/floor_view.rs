//! A camera above the floor plane, and the warp of that plane between two pictures.

use nalgebra::{Matrix3, Point2, SMatrix, Vector2, Vector3};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount, NEAR_PLANE_M};

/// Vertical component, per unit of depth, above which a ray counts as level: it has no floor point.
const LEVEL: f64 = -1e-6;

/// Derivative of a pixel by motion x, y (m) and theta (rad), mount tilt and roll (rad), and camera height (m).
pub type WarpJacobian = SMatrix<f64, 2, 6>;

/// A pinhole camera with its mount on the robot, above a level floor.
///
/// The robot frame has x forward, y left, z up, and its origin on the floor. Pixels are those of the undistorted
/// image. A *motion* is the pose of the current robot in the frame of the previous one; the *warp* takes pixels of the
/// current image to the previous one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorView {
    intrinsics: Intrinsics,
    mount: Mount,
    robot_from_camera: Matrix3<f64>,
    position: Vector3<f64>,
}

/// Rigid motion of the camera: a point of the current camera frame is `rotation * point + translation` in the previous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    /// Rotation from the current to the previous camera frame.
    pub rotation: Matrix3<f64>,
    /// Position of the current camera in the previous camera frame, m.
    pub translation: Vector3<f64>,
}

/// A pixel of the current image seen in the previous one, and its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warped {
    /// Pixel of the previous image.
    pub pixel: Vector2<f64>,
    /// Derivative by motion and mount.
    pub jacobian: WarpJacobian,
}

impl FloorView {
    /// Creates the view of a camera at this mount, whose height must be above 0.
    #[must_use]
    pub fn new(intrinsics: Intrinsics, mount: Mount) -> Self {
        let (robot_from_camera, position) = (mount.rotation_body_from_camera(), mount.position_in_body());
        Self { intrinsics, mount, robot_from_camera, position }
    }

    /// Returns the view of the camera tilted down by `tilt` and rolled to the right by `roll` (rad) from its mount.
    #[must_use]
    pub fn turned(&self, tilt: f64, roll: f64) -> Self {
        let mount = Mount { tilt: self.mount.tilt + tilt, roll: self.mount.roll + roll, ..self.mount };
        Self::new(self.intrinsics, mount)
    }

    /// Intrinsics of the undistorted image.
    #[must_use]
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Position of the camera in the robot frame, m.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }

    /// Rotation from the optical to the robot frame.
    #[must_use]
    pub fn robot_from_camera(&self) -> &Matrix3<f64> {
        &self.robot_from_camera
    }

    /// Unit axes of tilt and roll in the robot frame.
    #[must_use]
    pub fn tilt_and_roll_axes(&self) -> [Vector3<f64>; 2] {
        let (sin, cos) = self.mount.pan.sin_cos();
        let (sin_tilt, cos_tilt) = self.mount.tilt.sin_cos();
        [Vector3::new(-sin, cos, 0.0), Vector3::new(cos * cos_tilt, sin * cos_tilt, -sin_tilt)]
    }

    /// Ray through a pixel in the robot frame, with depth 1 along the optical axis.
    #[must_use]
    pub fn ray(&self, pixel: Vector2<f64>) -> Vector3<f64> {
        self.robot_from_camera * self.intrinsics.normalized_from_pixel(pixel).push(1.0)
    }

    /// Floor point of a pixel in the robot frame, m; `None` from the horizon upward.
    #[must_use]
    pub fn floor_point(&self, pixel: Vector2<f64>) -> Option<Point2<f64>> {
        let ray = self.ray(pixel);
        let scale = -self.position.z / ray.z;
        (ray.z < LEVEL).then(|| Point2::from(self.position.xy() + ray.xy() * scale))
    }

    /// Pixel of a point in the optical frame (m), or `None` nearer than [`NEAR_PLANE_M`].
    #[must_use]
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        let in_front = point_in_camera.z >= NEAR_PLANE_M;
        in_front.then(|| self.intrinsics.pixel_from_normalized(point_in_camera.xy() / point_in_camera.z))
    }

    /// Point of the robot frame in the optical frame, m.
    #[must_use]
    pub fn camera_from_robot(&self, point_in_robot: &Vector3<f64>) -> Vector3<f64> {
        self.robot_from_camera.tr_mul(&(point_in_robot - self.position))
    }

    /// Motion of the camera, for a motion of the robot.
    #[must_use]
    pub fn camera_motion(&self, motion: &Pose2) -> CameraMotion {
        let turn = turn(motion.theta);
        let shift = turn * self.position + Vector3::new(motion.x, motion.y, 0.0) - self.position;
        CameraMotion {
            rotation: self.robot_from_camera.tr_mul(&(turn * self.robot_from_camera)),
            translation: self.robot_from_camera.tr_mul(&shift),
        }
    }

    /// Homography from current to previous pixels of the level plane at `plane_height_m`, which must lie off the
    /// camera's height. Not scaled.
    #[must_use]
    pub fn homography(&self, motion: &Pose2, plane_height_m: f64) -> Matrix3<f64> {
        let CameraMotion { rotation, translation } = self.camera_motion(motion);
        let down = self.robot_from_camera.tr_mul(&-Vector3::z());
        let distance = self.position.z - plane_height_m;
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let inverse = Matrix3::new(1.0 / fx, 0.0, -cx / fx, 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0);
        self.intrinsics.matrix() * (rotation + translation * down.transpose() / distance) * inverse
    }

    /// Pixel of the previous image that shows the point of the plane at `plane_height_m` below the current `pixel`;
    /// `None` if there is no such point, or the previous camera had it nearer than [`NEAR_PLANE_M`].
    #[must_use]
    pub fn warp(&self, motion: &Pose2, plane_height_m: f64, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = self.ray(pixel);
        let depth = (plane_height_m - self.position.z) / ray.z;
        if ray.z >= LEVEL {
            return None;
        }
        let CameraMotion { rotation, translation } = self.camera_motion(motion);
        let in_camera = self.robot_from_camera.tr_mul(&ray) * depth;
        self.project(&(rotation * in_camera + translation))
    }

    /// Warp of a floor pixel with its derivative; `None` as for [`FloorView::warp`].
    #[must_use]
    pub fn warp_jacobian(&self, motion: &Pose2, pixel: Vector2<f64>) -> Option<Warped> {
        let ray = self.ray(pixel);
        if ray.z >= LEVEL {
            return None;
        }
        let (turn, depth) = (turn(motion.theta), -self.position.z / ray.z);
        let floor = self.position + ray * depth;
        let before = turn * floor + Vector3::new(motion.x, motion.y, 0.0);
        let in_camera = self.camera_from_robot(&before);
        let pixel = self.project(&in_camera)?;
        let slope = self.projection_slope(&in_camera);
        let to_pixel = |change: Vector3<f64>| slope * self.robot_from_camera.tr_mul(&change);
        let [tilt, roll] = self.tilt_and_roll_axes().map(|axis| {
            let turned = axis.cross(&ray);
            let moved = (turned - ray * (turned.z / ray.z)) * depth;
            to_pixel(turn * moved - axis.cross(&(before - self.position)))
        });
        let sunk = Vector3::new(-ray.x / ray.z, -ray.y / ray.z, 0.0);
        let columns = [
            to_pixel(Vector3::x()),
            to_pixel(Vector3::y()),
            to_pixel(Vector3::z().cross(&(turn * floor))),
            tilt,
            roll,
            to_pixel(turn * sunk - Vector3::z()),
        ];
        Some(Warped { pixel, jacobian: WarpJacobian::from_columns(&columns) })
    }

    /// Derivative of the pixel by the point in the optical frame, px/m.
    #[must_use]
    pub fn projection_slope(&self, point_in_camera: &Vector3<f64>) -> SMatrix<f64, 2, 3> {
        let (x, y, z) = (point_in_camera.x, point_in_camera.y, point_in_camera.z);
        let (fx, fy) = (self.intrinsics.fx / z, self.intrinsics.fy / z);
        SMatrix::<f64, 2, 3>::new(fx, 0.0, -fx * x / z, 0.0, fy, -fy * y / z)
    }
}

/// Rotation about the vertical by `theta`, rad.
#[must_use]
pub fn turn(theta: f64) -> Matrix3<f64> {
    let (sin, cos) = theta.sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}
