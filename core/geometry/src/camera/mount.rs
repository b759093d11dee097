//! Position and attitude of a camera on the robot.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A camera's position and attitude in the body frame (x forward, y left, z up), m and rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mount {
    /// Position forward of the robot's center, m.
    pub x: f64,
    /// Position left of the robot's center, m.
    pub y: f64,
    /// Height above the floor, m.
    pub z: f64,
    /// Rotation about the vertical, rad, positive to the left.
    pub pan: f64,
    /// Rotation about the lateral axis, rad, positive looks down (REP-103 pitch).
    pub tilt: f64,
    /// Rotation about the forward axis, rad, positive lowers the right side of the camera.
    pub roll: f64,
}

impl Mount {
    /// Creates the mount of a camera above the robot's center that looks straight ahead.
    #[must_use]
    pub fn level(height_m: f64) -> Self {
        Self { z: height_m, ..Self::default() }
    }

    /// Creates the mount of a camera above the robot's center that looks ahead and down by `tilt_rad`.
    #[must_use]
    pub fn tilted(height_m: f64, tilt_rad: f64) -> Self {
        Self { z: height_m, tilt: tilt_rad, ..Self::default() }
    }

    /// Returns the rigid transform from the optical frame to the body frame.
    #[must_use]
    pub fn body_from_camera(&self) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotation_body_from_camera());
        Isometry3::from_parts(
            Translation3::from(self.position_in_body()),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }

    /// Returns the rotation `Rz(pan) Ry(tilt) Rx(roll) A`, where the columns of A are the camera's right, down and
    /// forward axes in the body frame at zero angles.
    #[must_use]
    pub fn rotation_body_from_camera(&self) -> Matrix3<f64> {
        self.rotation_body_from_mirror() * Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0)
    }

    /// Returns the rigid transform from a mirror camera's frame (x forward, y left, z along the mirror's axis) to the
    /// body frame.
    #[must_use]
    pub fn body_from_mirror(&self) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotation_body_from_mirror());
        Isometry3::from_parts(
            Translation3::from(self.position_in_body()),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }

    /// Returns the rotation `Rz(pan) Ry(tilt) Rx(roll)` from a mirror camera's frame to the body frame.
    #[must_use]
    pub fn rotation_body_from_mirror(&self) -> Matrix3<f64> {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.pan)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), self.tilt)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), self.roll);
        turn.into_inner()
    }

    /// Returns the optical center in the body frame, m.
    #[must_use]
    pub fn position_in_body(&self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, self.z)
    }

    /// Returns true if all six numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.x, self.y, self.z, self.pan, self.tilt, self.roll].iter().all(|value| value.is_finite())
    }
}

/// A [`Mount`] as a robot file writes it: meters and degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MountConfig {
    /// Position forward of the robot's center.
    #[serde(default)]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub x_m: f64,
    /// Position left of the robot's center.
    #[serde(default)]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Height above the floor; distances to walls are derived from it.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub z_m: f64,
    /// Rotation about the vertical, positive to the left.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    pub pan_deg: f64,
    /// Downward tilt.
    #[serde(default)]
    #[schemars(range(min = -90.0, max = 90.0))]
    pub tilt_deg: f64,
    /// Rotation about the forward axis; positive lowers the right side.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    pub roll_deg: f64,
}

impl From<MountConfig> for Mount {
    fn from(config: MountConfig) -> Self {
        Self {
            x: config.x_m,
            y: config.y_m,
            z: config.z_m,
            pan: config.pan_deg.to_radians(),
            tilt: config.tilt_deg.to_radians(),
            roll: config.roll_deg.to_radians(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const FORWARD: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);
    const RIGHT: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);

    #[test]
    fn zero_angles_look_forward() {
        let body_from_camera = Mount::level(0.6).body_from_camera();
        assert!((body_from_camera * FORWARD - Vector3::x()).norm() < 1e-15);
        assert!((body_from_camera * RIGHT + Vector3::y()).norm() < 1e-15);
        let point_in_body = body_from_camera * Point3::new(0.5, 0.6, 3.0);
        assert!((point_in_body - Point3::new(3.0, -0.5, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn pan_turns_left_and_tilt_looks_down() {
        let panned = Mount { pan: 0.3, ..Mount::default() }.body_from_camera() * FORWARD;
        assert!(panned.y > 0.0 && panned.z.abs() < 1e-15);
        let tilted = Mount::tilted(1.0, 0.3).body_from_camera() * FORWARD;
        assert!(tilted.z < 0.0 && tilted.y.abs() < 1e-15);
        let rolled = Mount { roll: 0.3, ..Mount::default() }.body_from_camera() * RIGHT;
        assert!(rolled.z < 0.0, "a positive roll lowers the right side");
    }

    #[test]
    fn axes_of_the_unrolled_camera() {
        let (psi, tilt) = (0.4_f64, 0.2_f64);
        let rotation = Mount { pan: psi, tilt, ..Mount::default() }.rotation_body_from_camera();
        let right = Vector3::new(psi.sin(), -psi.cos(), 0.0);
        let down = Vector3::new(-psi.cos() * tilt.sin(), -psi.sin() * tilt.sin(), -tilt.cos());
        let forward = Vector3::new(psi.cos() * tilt.cos(), psi.sin() * tilt.cos(), -tilt.sin());
        assert!((rotation - Matrix3::from_columns(&[right, down, forward])).norm() < 1e-14);
    }

    #[test]
    fn the_height_is_required() {
        assert!(toml::from_str::<MountConfig>("tilt_deg = 6.0").unwrap_err().message().contains("z_m"));
        assert_eq!(toml::from_str::<MountConfig>("z_m = 0.6").unwrap().tilt_deg, 0.0);
    }

    #[test]
    fn config_is_in_degrees() {
        let mount = Mount::from(MountConfig { tilt_deg: 180.0, z_m: 0.5, ..MountConfig::default() });
        assert!((mount.tilt - std::f64::consts::PI).abs() < 1e-15 && mount.z == 0.5);
    }
}
