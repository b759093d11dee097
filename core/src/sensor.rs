//! The interface of a sensor, and the descriptions of sensors and robots that behaviors receive.

use nalgebra::Isometry3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::behavior::{Outputs, ParameterError, PublishError};
use crate::camera::{
    Calibration, Distortion, Intrinsics, IntrinsicsConfig, MirrorCamera, Mount, MountConfig, Pinhole,
};
use crate::message::{Axes, MessageType};
use crate::time::Time;

/// A device that measures and publishes.
pub trait Sensor: Send {
    /// Publishes all measurements due up to `now` on the output with the sensor's own name, and returns when to poll
    /// again.
    ///
    /// # Errors
    /// The device failed: the run ends or the device is restarted.
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError>;
}

/// Time of a sensor's next measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// Not before this time.
    At(Time),
    /// Never: the recording has ended.
    Ended,
}

/// Failure of a running device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The device cannot continue.
    #[error("device `{device}` failed: {reason}")]
    Failed {
        /// Its name in the robot file.
        device: String,
        /// Cause and remedy.
        reason: String,
    },
    /// The device's process reported a failure.
    #[error("{0}")]
    Reported(String),
    /// A measurement could not be published.
    #[error(transparent)]
    Publish(#[from] PublishError),
}

impl DeviceError {
    /// Creates the failure of `device` with its cause.
    pub fn failed(device: impl Into<String>, reason: impl ToString) -> DeviceError {
        DeviceError::Failed { device: device.into(), reason: reason.to_string() }
    }
}

/// Difference between the clock of a run and that of the machine above which the run is no live one, s.
const MAX_CLOCK_DIFFERENCE_S: f64 = 5.0;

/// Checks that `now`, on the clock of the run, is real time. A real device has no other.
///
/// # Errors
/// The run is in lockstep: the device `device` fails, with the remedy.
pub fn check_real_time(device: &str, now: Time) -> Result<(), DeviceError> {
    if now.seconds_after(Time::monotonic_now()).abs() <= MAX_CLOCK_DIFFERENCE_S {
        return Ok(());
    }
    Err(DeviceError::failed(device, "a real device works only in real time: add --live to the command"))
}

/// Description of a sensor, from the robot file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorInfo {
    /// Its name in the robot file.
    pub name: String,
    /// Versioned name of the message that it publishes, such as `yamabico.FrameHeader.v1`.
    pub message: &'static str,
    /// Time between measurements, s.
    pub period_s: f64,
    /// Latency from the middle of a measurement to its arrival, s.
    pub latency_s: f64,
    /// Properties that depend on the kind of sensor.
    pub kind: SensorKind,
}

/// A pinhole camera mounted on a robot, with valid parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountedPinhole {
    /// Lens and image.
    pub pinhole: Pinhole,
    /// Position and attitude on the robot.
    pub mount: Mount,
    /// Accuracy class of intrinsics and mount.
    pub calibration: Calibration,
    /// Time between frames, s.
    pub period_s: f64,
    /// Latency from the middle of the exposure to the frame's arrival, s.
    pub latency_s: f64,
}

/// A mirror camera mounted on a robot, with valid parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct MountedMirror {
    /// Mirror and image.
    pub camera: MirrorCamera,
    /// Position and attitude of the lens, or of the viewpoint of a radial model, on the robot.
    pub mount: Mount,
    /// Time between frames, s.
    pub period_s: f64,
    /// Latency from the middle of the exposure to the frame's arrival, s.
    pub latency_s: f64,
}

/// Properties of a sensor by its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SensorKind {
    /// A pinhole camera.
    Camera {
        /// Focal lengths and principal point, pixels, and image size.
        intrinsics: Intrinsics,
        /// Lens distortion.
        distortion: Distortion,
        /// Position and attitude on the robot.
        mount: Mount,
        /// Accuracy class of intrinsics and mount.
        calibrated: Calibration,
    },
    /// An omnidirectional camera that looks up at a mirror.
    MirrorCamera {
        /// Mirror and image.
        camera: Box<MirrorCamera>,
        /// Position and attitude of the lens, or of the viewpoint of a radial model, on the robot; upright at zero
        /// angles.
        mount: Mount,
        /// Accuracy class of mirror and mount.
        calibrated: Calibration,
    },
    /// A ring of sonars or a laser scanner.
    Range {
        /// Minimum range, m.
        min_m: f64,
        /// Maximum range, m.
        max_m: f64,
    },
    /// A sensor without further properties, such as wheel encoders.
    Other,
}

/// Description of the robot, from the robot file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    /// Name of the robot.
    pub name: String,
    /// Radius of the footprint's bounding circle about the robot's center, m.
    pub radius_m: f64,
    /// Motion limits of the drive.
    pub limits: MotionLimits,
    /// Axes that the drive can move.
    pub axes: Axes,
}

impl SensorKind {
    /// A pinhole camera with the parameters of a robot file.
    ///
    /// # Errors
    /// Invalid intrinsics.
    pub fn camera(
        config: &IntrinsicsConfig,
        mount: MountConfig,
        calibrated: Calibration,
    ) -> Result<SensorKind, ParameterError> {
        let intrinsics = config.intrinsics();
        if !intrinsics.is_valid() {
            return Err(ParameterError::new("intrinsics", "width, height and focal lengths must be above 0"));
        }
        let (distortion, mount) = (config.distortion, mount.into());
        Ok(SensorKind::Camera { intrinsics, distortion, mount, calibrated })
    }

    /// Returns the rigid transform from the camera's own frame (a pinhole's optical frame, a mirror's frame) to the
    /// body frame, or `None` for other sensors.
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

/// Motion limits of a drive. Each array holds the linear, lateral and angular axis, in units of m, m and rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionLimits {
    /// Maximum speed, per second.
    pub speed: [f64; 3],
    /// Maximum acceleration while speeding up, per second squared.
    pub acceleration: [f64; 3],
    /// Maximum deceleration in normal driving, per second squared.
    pub deceleration: [f64; 3],
    /// Deceleration of a halt and of the emergency stop, per second squared.
    pub emergency: [f64; 3],
    /// Maximum jerk, per second cubed.
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

/// A [`SensorInfo`] as another program sent it; its message type may be unknown here.
#[derive(Deserialize)]
struct SensorInfoFields {
    name: String,
    message: String,
    period_s: f64,
    latency_s: f64,
    kind: SensorKind,
}

impl<'de> Deserialize<'de> for SensorInfo {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SensorInfo, D::Error> {
        let SensorInfoFields { name, message, period_s, latency_s, kind } =
            SensorInfoFields::deserialize(deserializer)?;
        let known = MessageType::find(&message);
        let known = known.ok_or_else(|| D::Error::custom(MessageType::unknown(&message)))?;
        Ok(SensorInfo { name, message: known.name, period_s, latency_s, kind })
    }
}
