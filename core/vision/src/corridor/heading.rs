//! Conversion between the vanishing point of a corridor and the camera's heading and tilt, without small-angle
//! approximations.
//!
//! Kweon et al. (1991), section 3.1. Differs from \[1\]: their angles are those of a camera that pans about its own
//! axis after tilting; a robot yaws about the world's vertical axis.

use nalgebra::{Matrix2, Vector2, Vector3};
use yamabico_geometry::Hypotenuse;
use yamabico_geometry::camera::{Intrinsics, Mount};

/// Orientation of the optical axis relative to the corridor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraAttitude {
    /// Heading of the optical axis relative to the corridor axis, rad, positive to the left.
    pub heading: f64,
    /// Downward tilt of the optical axis, rad.
    pub tilt: f64,
}

impl CameraAttitude {
    /// Computes the attitude from a vanishing point in normalized image coordinates of a camera with this roll (rad).
    /// The heading is within ±pi/2.
    #[must_use]
    pub fn from_vanishing_point(normalized: Vector2<f64>, roll: f64) -> Self {
        let level = deroll(normalized, roll);
        let tilt = -level.y.atan();
        Self { heading: (level.x * tilt.cos()).atan(), tilt }
    }

    /// Computes the attitude from the corridor axis as a direction in the optical frame, for any heading, including a
    /// camera that faces backward.
    #[must_use]
    pub fn from_axis(axis_in_camera: Vector3<f64>, roll: f64) -> Self {
        let level = deroll(axis_in_camera.xy(), roll);
        let tilt = -(level.y / axis_in_camera.z).atan();
        Self { heading: level.x.atan2(axis_in_camera.z / tilt.cos()), tilt }
    }

    /// Vanishing point of the corridor, normalized image coordinates of a camera without roll. For a heading outside
    /// ±pi/2 it is the projection of the opposite direction, behind the camera.
    #[must_use]
    pub fn vanishing_point(&self) -> Vector2<f64> {
        Vector2::new(self.heading.tan() / self.tilt.cos(), -self.tilt.tan())
    }

    /// Derivatives of (heading, tilt) with respect to the normalized vanishing point, for a camera without roll.
    #[must_use]
    pub fn jacobian(&self) -> Matrix2<f64> {
        let ((sin_h, cos_h), (sin_t, cos_t)) = (self.heading.sin_cos(), self.tilt.sin_cos());
        Matrix2::new(cos_t * cos_h * cos_h, sin_h * cos_h * sin_t * cos_t, 0.0, -cos_t * cos_t)
    }

    /// Covariance of (heading, tilt), rad^2, propagated from the covariance of the vanishing point, px^2.
    #[must_use]
    pub fn covariance(&self, pixel_covariance: &Matrix2<f64>, intrinsics: &Intrinsics) -> Matrix2<f64> {
        let scale = Matrix2::from_diagonal(&Vector2::new(1.0 / intrinsics.fx, 1.0 / intrinsics.fy));
        let jacobian = self.jacobian() * scale;
        jacobian * pixel_covariance * jacobian.transpose()
    }
}

/// Heading of the robot relative to the corridor axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotHeading {
    /// Heading, rad, positive if the robot points to the left of the corridor axis.
    pub heading: f64,
    /// Elevation of the observed axis above the floor plane, rad. Nonzero values are noise or an error of the mount.
    pub elevation: f64,
}

impl RobotHeading {
    /// Computes the heading from the corridor axis as a direction in the optical frame. The sign of the direction
    /// matters.
    #[must_use]
    pub fn from_axis(axis_in_camera: Vector3<f64>, mount: &Mount) -> Self {
        let axis = mount.rotation_body_from_camera() * axis_in_camera;
        Self { heading: -axis.y.atan2(axis.x), elevation: axis.z.atan2(axis.x.hypotenuse(axis.y)) }
    }
}

/// Projects the corridor axis into the camera of a robot with this heading. Returns a homogeneous pixel, whose third
/// component is negative for a point behind the camera and zero for a point at infinity.
#[must_use]
pub fn vanishing_point_homogeneous(
    robot_heading: f64,
    mount: &Mount,
    intrinsics: &Intrinsics,
) -> Vector3<f64> {
    let axis_in_body = Vector3::new(robot_heading.cos(), -robot_heading.sin(), 0.0);
    intrinsics.matrix() * (mount.rotation_body_from_camera().transpose() * axis_in_body)
}

fn deroll(point: Vector2<f64>, roll: f64) -> Vector2<f64> {
    let (sin, cos) = roll.sin_cos();
    Vector2::new(point.x * cos - point.y * sin, point.x * sin + point.y * cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pointing_left_moves_the_point_right_and_looking_down_moves_it_up() {
        let at = CameraAttitude { heading: 0.1, tilt: 0.2 }.vanishing_point();
        assert!(at.x > 0.0 && at.y < 0.0);
    }

    #[test]
    fn attitude_survives_the_round_trip_with_roll() {
        for (heading, tilt, roll) in [(0.3, 0.1, 0.05), (-0.2, -0.04, -0.1), (0.0, 0.15, 0.0)] {
            let mount = Mount { tilt, roll, ..Mount::level(0.6) };
            let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.0);
            let pixel = vanishing_point_homogeneous(heading, &mount, &intrinsics);
            let normalized = intrinsics.normalized_from_pixel(pixel.xy() / pixel.z);
            let back = CameraAttitude::from_vanishing_point(normalized, roll);
            assert!((back.heading - heading).abs() < 1e-12 && (back.tilt - tilt).abs() < 1e-12);
            let robot = RobotHeading::from_axis(normalized.push(1.0), &mount);
            assert!((robot.heading - heading).abs() < 1e-12 && robot.elevation.abs() < 1e-12);
        }
    }

    #[test]
    fn a_camera_may_face_backward() {
        let mount = Mount::tilted(0.6, 0.1);
        let axis = mount.rotation_body_from_camera().transpose() * Vector3::new(-0.8, -0.6, 0.0);
        let back = CameraAttitude::from_axis(axis, 0.0);
        assert!((back.heading.cos() + 0.8).abs() < 1e-12 && (back.tilt - 0.1).abs() < 1e-12);
    }

    #[test]
    fn jacobian_matches_differences() {
        let at = CameraAttitude { heading: 0.3, tilt: 0.15 };
        let (point, h) = (at.vanishing_point(), 1e-6);
        for (column, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].into_iter().enumerate() {
            let (plus, minus) = (
                CameraAttitude::from_vanishing_point(point + step, 0.0),
                CameraAttitude::from_vanishing_point(point - step, 0.0),
            );
            let difference = Vector2::new(plus.heading - minus.heading, plus.tilt - minus.tilt) / (2.0 * h);
            assert!((difference - at.jacobian().column(column)).norm() < 1e-9);
        }
    }
}
