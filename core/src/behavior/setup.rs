//! What a behavior is built with.

use std::path::PathBuf;

use super::{BuildError, Slot};
use crate::camera::Pinhole;
use crate::message::FrameHeader;
use crate::sensor::{MountedMirror, MountedPinhole, Robot, SensorInfo, SensorKind};

/// What a behavior is told when it is built.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Its instance name in the task file.
    pub name: String,
    /// The robot that it is for.
    pub robot: Robot,
    /// Relative paths in its keys start here.
    pub folder: PathBuf,
    /// What is plugged into each of its slots: slot name and the sensor, where it is a sensor.
    pub sensors: Vec<(String, SensorInfo)>,
}

impl Setup {
    /// The sensor in `slot`; `None` where the slot is empty or fed by a behavior.
    pub fn sensor<M>(&self, slot: &Slot<M>) -> Option<&SensorInfo> {
        self.sensors.iter().find(|(name, _)| name == slot.name).map(|(_, info)| info)
    }

    /// The pinhole camera in `slot`.
    ///
    /// # Errors
    /// Anything else in the slot, and a camera whose intrinsics or mount are no usable numbers.
    pub fn pinhole(&self, slot: &Slot<FrameHeader>) -> Result<MountedPinhole, BuildError> {
        let refused = |problem: &str| Err(BuildError::new(format!("inputs.{}", slot.name), problem));
        let Some(SensorInfo {
            kind: SensorKind::Camera { intrinsics, distortion, mount, calibrated },
            period_s,
            latency_s,
            ..
        }) = self.sensor(slot)
        else {
            return refused("needs a pinhole camera of the robot");
        };
        if !intrinsics.is_valid() || !mount.is_finite() {
            return refused("the camera's intrinsics or mount are no usable numbers");
        }
        let pinhole = Pinhole::new(*intrinsics, *distortion);
        let (period_s, latency_s) = (*period_s, *latency_s);
        Ok(MountedPinhole { pinhole, mount: *mount, calibration: *calibrated, period_s, latency_s })
    }

    /// The mirror camera in `slot`.
    ///
    /// # Errors
    /// Anything else in the slot, and a mount of no usable numbers.
    pub fn mirror_camera(&self, slot: &Slot<FrameHeader>) -> Result<MountedMirror, BuildError> {
        let refused = |problem: &str| Err(BuildError::new(format!("inputs.{}", slot.name), problem));
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
                refused("the camera's mount has no usable numbers")
            }
            _ => refused("needs a mirror camera of the robot"),
        }
    }
}
