//! Parameters of a recording and of its sensors in a robot file.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};

/// Empty parameters, of a drive without any.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// Parameters of a recording as a device.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeviceConfig {
    /// MCAP file of this program or of ROS 2, or folder of rosbag2; relative to the robot file, or to the working directory on
    /// the command line.
    #[schemars(extend("format" = "file or folder"))]
    pub file: String,
    /// Time in the recording at which it starts.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub from_s: f64,
    /// Seconds of the recording per second of the run. In lockstep a run is computed as fast as possible, whatever this is.
    #[serde_inline_default(1.0)]
    #[schemars(range(min = 0.01, max = 100.0))]
    pub pace: f64,
}

/// Parameters of a recorded sensor without further properties.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TopicConfig {
    /// Topic in the file, such as `sensors/wheels` or `/odom`; `yamabico info` lists them.
    pub topic: String,
    /// Nominal rate of the measurements.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from a measurement to its arrival; the recorded delay is kept.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
}

/// Parameters of odometry from the recorded joints of two driven wheels.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WheelsConfig {
    /// Topic in the file, such as `/joint_states`; `yamabico info` lists them.
    pub topic: String,
    /// Nominal rate of the measurements.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from a measurement to its arrival; the recorded delay is kept.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Name of the joint of the left wheel.
    pub left: String,
    /// Name of the joint of the right wheel.
    pub right: String,
    /// Radius of the wheels.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub radius_m: f64,
    /// Distance between the wheels.
    #[schemars(range(min = 0.02, max = 3.0))]
    pub track_m: f64,
}

/// Parameters of recorded sonars or of a recorded laser scanner.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeConfig {
    /// Topic in the file, such as `sensors/front-sonar` or `/scan`; `yamabico info` lists them.
    pub topic: String,
    /// Nominal rate of the measurements.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from a measurement to its arrival; the recorded delay is kept.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Minimum range; a shorter one of a scan is no echo.
    #[serde_inline_default(0.05)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub min_m: f64,
    /// Maximum range; a longer one of a scan is no echo.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub max_m: f64,
    /// Pose of a laser scanner of ROS 2 on the robot: forward, m.
    #[serde(default)]
    #[schemars(range(min = -10.0, max = 10.0))]
    pub x_m: f64,
    /// Likewise: to the left, m.
    #[serde(default)]
    #[schemars(range(min = -10.0, max = 10.0))]
    pub y_m: f64,
    /// Likewise: direction of its angle zero, degrees to the left.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    pub yaw_deg: f64,
}

/// Parameters of a recorded camera.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Topic in the file, such as `sensors/front` or `/image/compressed`; `yamabico info` lists them.
    pub topic: String,
    /// Nominal frame rate.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from the middle of the exposure to the delivery of a frame; the recorded delay is kept.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Image size, focal length and principal point; images of another size are left out.
    pub intrinsics: IntrinsicsConfig,
    /// Accuracy of intrinsics and mount. If guessed, behaviors treat directions as approximate and do not use distances.
    #[serde_inline_default(Calibration::Guessed)]
    pub calibration: Calibration,
    /// Pose on the robot.
    pub mount: MountConfig,
}

impl CameraConfig {
    /// Returns the maximum size of one image, bytes: three colors per pixel.
    pub fn bytes(&self) -> usize {
        3 * self.intrinsics.width as usize * self.intrinsics.height as usize
    }
}
