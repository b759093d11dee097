//! Context in which a behavior is built: its name, robot and sensors.

use std::path::PathBuf;

use super::{ParameterError, Slot};
use crate::camera::Pinhole;
use crate::message::FrameHeader;
use crate::sensor::{MountedMirror, MountedPinhole, Robot, SensorInfo, SensorKind};

/// Context in which a behavior is built, besides its own parameters.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Name of this instance in the task file.
    pub name: String,
    /// The robot that it will drive.
    pub robot: Robot,
    /// Folder against which relative paths in its parameters are resolved.
    pub folder: PathBuf,
    /// The sensor connected to each slot, by slot name. Slots that a behavior feeds are not listed.
    pub sensors: Vec<(String, SensorInfo)>,
    /// Names of the connected slots, whatever feeds them; `None` if that is unknown, as in most tests.
    pub connected: Option<Vec<String>>,
}

impl Setup {
    /// Returns true if nothing is connected to `slot`; false if that is unknown.
    pub fn is_empty<M>(&self, slot: &Slot<M>) -> bool {
        self.connected.as_ref().is_some_and(|connected| connected.iter().all(|name| name != slot.name))
    }

    /// Returns the sensor connected to `slot`, or `None` if the slot is empty or fed by a behavior.
    pub fn sensor<M>(&self, slot: &Slot<M>) -> Option<&SensorInfo> {
        self.sensors.iter().find(|(name, _)| name == slot.name).map(|(_, info)| info)
    }

    /// Returns the pinhole camera connected to `slot`.
    ///
    /// # Errors
    /// No pinhole camera is connected, or its intrinsics or mount are invalid.
    pub fn pinhole(&self, slot: &Slot<FrameHeader>) -> Result<MountedPinhole, ParameterError> {
        let refused = |problem: &str| Err(ParameterError::new(format!("inputs.{}", slot.name), problem));
        let Some(SensorInfo {
            kind: SensorKind::Camera { intrinsics, distortion, mount, calibrated },
            period_s,
            latency_s,
            ..
        }) = self.sensor(slot)
        else {
            return refused("must be a pinhole camera of the robot");
        };
        if !intrinsics.is_valid() || !mount.is_finite() {
            return refused(
                "the camera's intrinsics or mount are invalid: numbers must be finite, focal lengths and size above 0",
            );
        }
        let pinhole = Pinhole::new(*intrinsics, *distortion);
        let (period_s, latency_s) = (*period_s, *latency_s);
        Ok(MountedPinhole { pinhole, mount: *mount, calibration: *calibrated, period_s, latency_s })
    }

    /// Returns the mirror camera connected to `slot`.
    ///
    /// # Errors
    /// No mirror camera is connected, or its mount is invalid.
    pub fn mirror_camera(&self, slot: &Slot<FrameHeader>) -> Result<MountedMirror, ParameterError> {
        let refused = |problem: &str| Err(ParameterError::new(format!("inputs.{}", slot.name), problem));
        match self.sensor(slot) {
            Some(&SensorInfo {
                kind: SensorKind::MirrorCamera { ref camera, mount, .. },
                period_s,
                latency_s,
                ..
            }) if mount.is_finite() => {
                Ok(MountedMirror { camera: (**camera).clone(), mount, period_s, latency_s })
            }
            Some(SensorInfo { kind: SensorKind::MirrorCamera { .. }, .. }) => {
                refused("the camera's mount is invalid: its numbers must be finite")
            }
            _ => refused("must be a mirror camera of the robot"),
        }
    }
}
