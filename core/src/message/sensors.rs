//! Measurements, and the clock of a run.

use super::{Name, Twist, code_enum, item, message};
use crate::geometry::Pose2;

code_enum! {
    /// Pixel format of a frame.
    #[derive(Default, serde::Deserialize, schemars::JsonSchema)]
    #[serde(rename_all = "kebab-case")]
    pub enum Encoding {
        /// Gray, one byte per pixel.
        #[default]
        Gray8 = 1 "gray8",
        /// Red, green, blue; three bytes per pixel.
        Rgb8 = 2 "rgb8",
    }
}

impl Encoding {
    /// Returns the number of bytes per pixel.
    pub const fn bytes_per_pixel(self) -> u32 {
        match self {
            Encoding::Gray8 => 1,
            Encoding::Rgb8 => 3,
        }
    }
}

message! {
    /// A camera frame. Its items are the pixels, row by row.
    "yamabico.FrameHeader.v1" Latest [u8]
    pub struct FrameHeader {
        /// Middle of the exposure.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Image width, pixels.
        pub width: u32,
        /// Image height, pixels.
        pub height: u32,
        /// Distance between the beginnings of two rows, bytes.
        pub stride: u32,
        /// An [`Encoding`] code.
        pub encoding: u32,
        /// Exposure time times gain, relative to the camera's nominal value.
        pub exposure: f64,
    }
}

impl FrameHeader {
    /// Creates the header of a gray frame without padding between its rows.
    #[must_use]
    pub fn gray(width: u32, height: u32, stamp_ns: u64) -> Self {
        Self { stamp_ns, ..Self::new(Encoding::Gray8, [width, height]) }
    }

    /// Creates the header of a frame of this size (width and height, pixels) without padding between its rows; its stamp and sequence
    /// number are zero.
    #[must_use]
    pub fn new(encoding: Encoding, [width, height]: [u32; 2]) -> Self {
        let stride = width * encoding.bytes_per_pixel();
        Self { width, height, stride, encoding: encoding.code(), exposure: 1.0, ..Self::default() }
    }

    /// Returns the pixel format, or `None` if the code is undefined.
    pub fn encoding(&self) -> Option<Encoding> {
        Encoding::from_code(self.encoding)
    }
}

message! {
    /// A range scan of sonars or of a laser scanner. Its items are the beams.
    "yamabico.RangeScanHeader.v1" Stream [Beam]
    pub struct RangeScanHeader {
        /// Time of the measurement.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Minimum range of the sensor, m.
        pub min_m: f64,
        /// Maximum range of the sensor, m.
        pub max_m: f64,
    }
}

/// Flag of a [`Beam`]: no echo within the maximum range.
pub const NO_ECHO: u32 = 1;

item! {
    /// One beam of a range scan.
    pub struct Beam {
        /// Direction of the beam's axis in the robot frame, rad, positive to the left.
        pub azimuth_rad: f64,
        /// Full opening angle, rad.
        pub cone_rad: f64,
        /// Distance from the sensor, m; undefined if [`NO_ECHO`] is set.
        pub range_m: f64,
        /// Forward position of the sensor in the robot frame, m.
        pub x_m: f64,
        /// Left position of the sensor in the robot frame, m.
        pub y_m: f64,
        /// [`NO_ECHO`] or zero.
        pub flags: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Beam {
    /// Returns the range if there was an echo. A NaN is passed on, to be rejected by the caller.
    pub fn echo_m(&self) -> Option<f64> {
        (self.flags & NO_ECHO == 0).then_some(self.range_m)
    }
}

message! {
    /// Wheel odometry: a pose estimate in the odom frame, which drifts but never jumps.
    "yamabico.Odometry.v1" Stream [u8]
    pub struct Odometry {
        /// Time at which the encoders were read.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Position along x of the odom frame, m.
        pub x: f64,
        /// Position along y of the odom frame, m.
        pub y: f64,
        /// Heading, rad in (-pi, pi], positive to the left.
        pub theta: f64,
        /// Forward speed, m/s, robot frame.
        pub vx: f64,
        /// Speed to the left, m/s, robot frame.
        pub vy: f64,
        /// Turn rate, rad/s, positive to the left.
        pub omega: f64,
        /// Covariance of (x, y, theta), row-major, in m and rad.
        pub covariance: [f64; 9],
    }
}

impl Odometry {
    /// Creates a reading from a pose (odom frame) and a twist (robot frame), with zero covariance.
    #[must_use]
    pub fn new(stamp_ns: u64, pose: &Pose2, twist: &Twist) -> Self {
        let Pose2 { x, y, theta } = *pose;
        let Twist { linear: vx, lateral: vy, angular: omega } = *twist;
        Self { stamp_ns, x, y, theta, vx, vy, omega, ..Self::default() }
    }
}

message! {
    /// Inertial measurement in the robot frame.
    "yamabico.Imu.v1" Stream [u8]
    pub struct Imu {
        /// Time of the measurement.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Angular velocity about x, y and z, rad/s.
        pub angular_velocity: [f64; 3],
        /// Acceleration along x, y and z, m/s^2, gravity included.
        pub linear_acceleration: [f64; 3],
        /// Attitude about x, rad; NaN if the device does not measure it.
        pub roll: f64,
        /// Attitude about y, rad, positive looks down; NaN if the device does not measure it.
        pub pitch: f64,
    }
}

message! {
    /// State of the bumpers.
    "yamabico.Bumper.v1" Stream [u8]
    pub struct Bumper {
        /// Time of the measurement.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Bit mask of the pressed bumpers, the first one in the lowest bit.
        pub pressed: u64,
    }
}

message! {
    /// Clock of a run that is not paced by the machine's clock.
    "yamabico.Clock.v1" Stream [u8] counted by step
    pub struct Clock {
        /// Time at the beginning of the step.
        pub stamp_ns: u64,
        /// Sequence number.
        pub step: u64,
    }
}

code_enum! {
    /// Phase of a step.
    pub enum StepPhase {
        /// Plugins receive their messages.
        Collect = 0 "collect",
        /// Behaviors with new input propose.
        Propose = 1 "propose",
        /// The step is complete: the driver applies the command and begins the next step.
        Done = 2 "done",
    }
}

message! {
    /// Synchronization of the steps of a run that is not paced by the machine's clock. The arbiter announces a phase;
    /// each plugin acknowledges it.
    "yamabico.Turn.v1" Stream [u8]
    pub struct StepSignal {
        /// Time of the step.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Step number of the [`Clock`] message.
        pub step: u64,
        /// Name of the plugin that acknowledges; empty in an announcement.
        pub plugin: Name,
        /// A [`StepPhase`] code.
        pub phase: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl StepSignal {
    /// Returns the phase, or `None` if the code is undefined.
    pub fn phase(&self) -> Option<StepPhase> {
        StepPhase::from_code(self.phase)
    }
}

message! {
    /// Ground truth of a simulator, to score a run. No behavior may take it as an input.
    "yamabico.Truth.v1" Stream [u8]
    pub struct Truth {
        /// Time that it describes.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Position along x of the map frame, m.
        pub x: f64,
        /// Position along y of the map frame, m.
        pub y: f64,
        /// Heading in the map frame, rad in (-pi, pi].
        pub theta: f64,
        /// Forward speed, m/s.
        pub vx: f64,
        /// Speed to the left, m/s.
        pub vy: f64,
        /// Turn rate, rad/s, positive to the left.
        pub omega: f64,
        /// Path length since the start, m.
        pub distance_m: f64,
        /// Distance from the footprint to the nearest obstacle, m; negative when they overlap.
        pub clearance_m: f64,
        /// Distance from the footprint to the nearest person, m; infinite without people.
        pub person_m: f64,
        /// Number of contacts caused by the robot's motion.
        pub contacts: u32,
        /// Number of times that a person walked into the standing robot.
        pub struck: u32,
    }
}
