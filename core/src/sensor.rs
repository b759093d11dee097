//! The seam that a sensor implements, and what is known of a sensor and of a robot.

use nalgebra::Isometry3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::behavior::{Outputs, PublishError};
use crate::camera::{Calibration, Distortion, Intrinsics, MirrorCamera, Mount, Pinhole};
use crate::message::{Axes, MessageType};
use crate::time::Time;

/// A device that measures and publishes.
pub trait Sensor: Send {
    /// Publishes everything that is due up to `now` on the output of the sensor's own name, and tells when to come back.
    ///
    /// # Errors
    /// The device failed; the run ends or the sensor is restarted.
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError>;
}

/// When a sensor has something again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// Not before this instant.
    At(Time),
    /// Never: a recording has ended.
    Ended,
}

/// A device that failed while it ran.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// It cannot go on.
    #[error("device `{device}` failed: {reason}")]
    Failed {
        /// Its name in the robot file.
        device: String,
        /// What happened and what to do.
        reason: String,
    },
    /// Its process told so.
    #[error("{0}")]
    Told(String),
    /// What it measured could not be published.
    #[error(transparent)]
    Publish(#[from] PublishError),
}

impl DeviceError {
    /// `device` failed because of `reason`.
    pub fn failed(device: impl Into<String>, reason: impl ToString) -> DeviceError {
        DeviceError::Failed { device: device.into(), reason: reason.to_string() }
    }
}

/// What a behavior may know of a sensor: from the robot file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorInfo {
    /// Its name in the robot file.
    pub name: String,
    /// Name of what it publishes, such as `yamabico.FrameHeader.v1`.
    pub message: &'static str,
    /// Seconds from one measurement to the next.
    pub period_s: f64,
    /// Seconds from the middle of a measurement to its arrival.
    pub latency_s: f64,
    /// What depends on the kind of sensor.
    pub kind: SensorKind,
}

/// A pinhole camera on a robot, with usable numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountedPinhole {
    /// Lens and image.
    pub pinhole: Pinhole,
    /// Where it sits on the robot.
    pub mount: Mount,
    /// Whether the intrinsics were measured, not guessed.
    pub calibration: Calibration,
    /// Seconds from one picture to the next.
    pub period_s: f64,
    /// Seconds from the middle of the exposure to the picture's arrival.
    pub latency_s: f64,
}

/// A mirror camera on a robot, with usable numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct MountedMirror {
    /// Mirror and image.
    pub camera: MirrorCamera,
    /// Where the lens, or the viewpoint of a radial model, sits on the robot.
    pub mount: Mount,
    /// Seconds from one picture to the next.
    pub period_s: f64,
    /// Seconds from the middle of the exposure to the picture's arrival.
    pub latency_s: f64,
}

/// What is known of a sensor by its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SensorKind {
    /// A pinhole camera.
    Camera {
        /// Focal lengths, center and size, pixels.
        intrinsics: Intrinsics,
        /// Of the lens.
        distortion: Distortion,
        /// Where it sits on the robot.
        mount: Mount,
        /// Whether the intrinsics were measured, not guessed.
        calibrated: Calibration,
    },
    /// A camera that looks all around through a mirror.
    MirrorCamera {
        /// The mirror and its image.
        camera: Box<MirrorCamera>,
        /// Where the lens, or the viewpoint of a radial model, sits on the robot; upright at zero angles.
        mount: Mount,
        /// Whether mirror and mount were measured, not guessed.
        calibrated: Calibration,
    },
    /// Sonars or a laser.
    Range {
        /// Nearest range, meters.
        min_m: f64,
        /// Farthest range, meters.
        max_m: f64,
    },
    /// Anything that needs no description.
    Other,
}

/// What is known of the robot: from the robot file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Radius of the circle about the center that holds the whole robot, meters.
    pub radius_m: f64,
    /// What it can do.
    pub limits: MotionLimits,
    /// Axes that the drive has.
    pub axes: Axes,
}

impl SensorKind {
    /// The rigid transform from a camera's own frame (a pinhole's optical frame, a mirror's frame) to the body frame;
    /// `None` for what is no camera.
    #[must_use]
    pub fn body_from_camera(&self) -> Option<Isometry3<f64>> {
        match self {
            SensorKind::Camera { mount, .. } => Some(mount.body_from_camera()),
            SensorKind::MirrorCamera { mount, .. } => Some(mount.body_from_mirror()),
            SensorKind::Range { .. } | SensorKind::Other => None,
        }
    }
}

impl Default for Robot {
    fn default() -> Self {
        Robot { name: "robot".into(), radius_m: 0.25, limits: MotionLimits::default(), axes: Axes::PLANAR }
    }
}

/// What a robot's drive can do. Each triple is for the linear, lateral and angular axis: m and m, rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionLimits {
    /// Largest speed, per second.
    pub speed: [f64; 3],
    /// Largest acceleration while speeding up, per second squared.
    pub acceleration: [f64; 3],
    /// Largest deceleration in normal driving, per second squared.
    pub deceleration: [f64; 3],
    /// Deceleration of a halt and of the emergency stop, per second squared.
    pub emergency: [f64; 3],
    /// Largest change of acceleration, per second cubed.
    pub jerk: [f64; 3],
}

impl Default for MotionLimits {
    fn default() -> Self {
        MotionLimits {
            speed: [0.6, 0.0, 1.2],
            acceleration: [0.5, 0.5, 2.0],
            deceleration: [0.8, 0.8, 3.0],
            emergency: [1.5, 1.5, 6.0],
            jerk: [5.0, 5.0, 20.0],
        }
    }
}

/// A [`SensorInfo`] from another program, which may know other messages.
#[derive(Deserialize)]
struct ToldInfo {
    name: String,
    message: String,
    period_s: f64,
    latency_s: f64,
    kind: SensorKind,
}

impl<'de> Deserialize<'de> for SensorInfo {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SensorInfo, D::Error> {
        let ToldInfo { name, message, period_s, latency_s, kind } = ToldInfo::deserialize(deserializer)?;
        let known = MessageType::find(&message);
        let known = known.ok_or_else(|| D::Error::custom(MessageType::unknown(&message)))?;
        Ok(SensorInfo { name, message: known.name, period_s, latency_s, kind })
    }
}
