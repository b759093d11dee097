//! Parameters of devices and behaviors.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};

use crate::network_config::{MAX_DOMAIN, Middleware, NetworkConfig};

/// Reliability that a subscriber asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reliability {
    /// Lost messages are lost. Fits every publisher.
    #[default]
    BestEffort,
    /// Lost messages are sent again, late. Fits reliable publishers only.
    Reliable,
}

/// Type of the messages of velocity commands that a drive sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TwistType {
    /// Each type that the topic is subscribed with.
    #[default]
    Auto,
    /// Twist.
    Twist,
    /// TwistStamped.
    TwistStamped,
}

/// Parameters of a robot on ROS 2 as a device.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeviceConfig {
    /// Domain. Without it, that of the variable ROS_DOMAIN_ID, or 0.
    #[schemars(range(min = 0, max = MAX_DOMAIN))]
    pub domain: Option<u16>,
    /// Middleware. Without it, that of the variable RMW_IMPLEMENTATION, or DDS; Zenoh if `router` is set.
    pub middleware: Option<Middleware>,
    /// Endpoint of a Zenoh router, such as `tcp/192.168.1.5:7447`. Without it, that of rmw_zenoh on this machine.
    pub router: Option<String>,
}

/// Parameters of a sensor without further properties.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TopicConfig {
    /// Topic, such as `/odom`.
    pub topic: String,
    /// Nominal rate of the messages.
    #[serde_inline_default(20.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from a measurement to its arrival; the delay of each message is measured by its stamp.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.0, max = 2000.0))]
    pub latency_ms: f64,
    /// Reliability that is asked for.
    #[serde(default)]
    pub reliability: Reliability,
}

/// Parameters of range sensors: LaserScan, or one Range.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeConfig {
    /// Topic, such as `/scan`.
    pub topic: String,
    /// Nominal rate of the messages.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from a measurement to its arrival; the delay of each message is measured by its stamp.
    #[serde_inline_default(20.0)]
    #[schemars(range(min = 0.0, max = 2000.0))]
    pub latency_ms: f64,
    /// Reliability that is asked for.
    #[serde(default)]
    pub reliability: Reliability,
    /// Minimum range; a shorter one is no echo.
    #[serde_inline_default(0.05)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub min_m: f64,
    /// Maximum range; a longer one is no echo.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub max_m: f64,
    /// Pose of the scanner on the robot: forward. Without this and the next two, the pose comes from `/tf_static`.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub x_m: Option<f64>,
    /// Likewise: to the left.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub y_m: Option<f64>,
    /// Likewise: direction of its angle zero, positive to the left.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub yaw_deg: Option<f64>,
}

/// Parameters of a camera: CompressedImage, or Image.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Topic, such as `/camera/image_raw/compressed`.
    pub topic: String,
    /// Topic of the CameraInfo, whose intrinsics are compared with those below.
    pub camera_info: Option<String>,
    /// Nominal frame rate.
    #[serde_inline_default(15.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Nominal delay from the middle of the exposure to the arrival of a frame; the delay of each is measured by its stamp.
    #[serde_inline_default(50.0)]
    #[schemars(range(min = 0.0, max = 2000.0))]
    pub latency_ms: f64,
    /// Reliability that is asked for.
    #[serde(default)]
    pub reliability: Reliability,
    /// Image size, focal length and principal point; images of another size are left out.
    pub intrinsics: IntrinsicsConfig,
    /// Accuracy of intrinsics and mount. If guessed, behaviors treat directions as approximate and do not use distances.
    #[serde_inline_default(Calibration::Guessed)]
    pub calibration: Calibration,
    /// Pose on the robot.
    pub mount: MountConfig,
}

/// Parameters of a drive that sends velocity commands.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveConfig {
    /// Topic that the base subscribes.
    #[serde_inline_default("/cmd_vel".to_owned())]
    pub topic: String,
    /// Type of the messages.
    #[serde(default)]
    pub message: TwistType,
    /// Frame in the headers of TwistStamped.
    #[serde_inline_default("base_link".to_owned())]
    pub frame_id: String,
    /// Maximum rate of the messages; a stop is sent at once.
    #[serde_inline_default(50.0)]
    #[schemars(range(min = 5.0, max = 200.0))]
    pub rate_hz: f64,
    /// Maximum speed that is sent; a faster motion is slowed down on its curve. Without it, the limits of the robot count.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub max_mps: Option<f64>,
    /// Time without a command of the arbiter after which zero is sent.
    #[serde_inline_default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
}

/// Parameters of a topic of velocity commands as a behavior.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VelocityConfig {
    /// Topic of Twist or TwistStamped messages, such as `/cmd_vel_nav`.
    pub ros2_twist: String,
    /// Time without a message after which the behavior abstains.
    #[serde_inline_default(500.0)]
    #[schemars(range(min = 20.0, max = 60000.0))]
    pub timeout_ms: f64,
    /// Reliability that is asked for.
    #[serde(default)]
    pub reliability: Reliability,
    /// Domain. Without it, that of the variable ROS_DOMAIN_ID, or 0.
    #[schemars(range(min = 0, max = MAX_DOMAIN))]
    pub domain: Option<u16>,
    /// Middleware. Without it, that of the variable RMW_IMPLEMENTATION, or DDS; Zenoh if `router` is set.
    pub middleware: Option<Middleware>,
    /// Endpoint of a Zenoh router, such as `tcp/192.168.1.5:7447`. Without it, that of rmw_zenoh on this machine.
    pub router: Option<String>,
}

/// Parameters of a lock: a topic that stops all behaviors of lower priority.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LockConfig {
    /// Topic of Bool messages, such as `/pause`: true locks.
    pub ros2_lock: String,
    /// Time without a message after which the lock closes, and until the first one. With 0, silence does not lock.
    #[serde_inline_default(0.0)]
    #[schemars(range(min = 0.0, max = 60000.0))]
    pub timeout_ms: f64,
    /// Reliability that is asked for.
    #[serde(default)]
    pub reliability: Reliability,
    /// Domain. Without it, that of the variable ROS_DOMAIN_ID, or 0.
    #[schemars(range(min = 0, max = MAX_DOMAIN))]
    pub domain: Option<u16>,
    /// Middleware. Without it, that of the variable RMW_IMPLEMENTATION, or DDS; Zenoh if `router` is set.
    pub middleware: Option<Middleware>,
    /// Endpoint of a Zenoh router, such as `tcp/192.168.1.5:7447`. Without it, that of rmw_zenoh on this machine.
    pub router: Option<String>,
}

/// Parameters of an observer, which publishes what the robot does.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObserverConfig {
    /// Beginning of the names of its topics, such as `/yamabico`.
    pub ros2_publish: String,
    /// Rate of decisions and diagnostics; a change of the arbiter's mode, or of the behavior that drives, is sent at once.
    #[serde_inline_default(5.0)]
    #[schemars(range(min = 0.1, max = 50.0))]
    pub rate_hz: f64,
    /// Frame of the odometry.
    #[serde_inline_default("odom".to_owned())]
    pub odom_frame: String,
    /// Frame of the robot.
    #[serde_inline_default("base_link".to_owned())]
    pub base_frame: String,
    /// Frame of the map.
    #[serde_inline_default("map".to_owned())]
    pub map_frame: String,
    /// Domain. Without it, that of the variable ROS_DOMAIN_ID, or 0.
    #[schemars(range(min = 0, max = MAX_DOMAIN))]
    pub domain: Option<u16>,
    /// Middleware. Without it, that of the variable RMW_IMPLEMENTATION, or DDS; Zenoh if `router` is set.
    pub middleware: Option<Middleware>,
    /// Endpoint of a Zenoh router, such as `tcp/192.168.1.5:7447`. Without it, that of rmw_zenoh on this machine.
    pub router: Option<String>,
}

/// Gives each of the configurations its network.
macro_rules! network_of {
    ($($config:ident),*) => {
        $(impl $config {
            /// Returns the keys of the network.
            #[must_use]
            pub fn network(&self) -> NetworkConfig {
                NetworkConfig { domain: self.domain, middleware: self.middleware, router: self.router.clone() }
            }
        })*
    };
}

network_of!(DeviceConfig, VelocityConfig, LockConfig, ObserverConfig);
