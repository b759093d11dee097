//! What sensors measure.

use super::{Name, Twist, item, message, vocabulary};
use crate::geometry::Pose2;

vocabulary! {
    /// How the bytes of a frame are to be read.
    pub enum Encoding {
        /// One byte a pixel.
        Gray8 = 1 "gray8",
        /// Red, green, blue; three bytes a pixel.
        Rgb8 = 2 "rgb8",
    }
}

impl Encoding {
    /// Bytes that one pixel takes.
    pub const fn bytes_per_pixel(self) -> u32 {
        match self {
            Encoding::Gray8 => 1,
            Encoding::Rgb8 => 3,
        }
    }
}

message! {
    /// A picture; the pixels follow, row by row, `stride` bytes from one row to the next.
    "yamabico.FrameHeader.v1" Latest [u8]
    pub struct FrameHeader {
        /// Middle of the exposure.
        pub stamp_ns: u64,
        /// Counts up by one a picture.
        pub sequence: u64,
        /// Pixels in a row.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// Bytes from one row to the next.
        pub stride: u32,
        /// An [`Encoding`] code.
        pub encoding: u32,
        /// Exposure time times gain, relative to the camera's nominal one.
        pub exposure: f64,
    }
}

impl FrameHeader {
    /// Of a gray picture without padding at the ends of its rows.
    #[must_use]
    pub fn gray(width: u32, height: u32, stamp_ns: u64) -> Self {
        let encoding = Encoding::Gray8.code();
        Self { stamp_ns, width, height, stride: width, encoding, ..Self::default() }
    }

    /// The encoding, where the code is known.
    pub fn encoding(&self) -> Option<Encoding> {
        Encoding::from_code(self.encoding)
    }
}

message! {
    /// Ranges taken together; the beams follow.
    "yamabico.RangeScanHeader.v1" Stream [Beam]
    pub struct RangeScanHeader {
        /// When the echoes were awaited.
        pub stamp_ns: u64,
        /// Counts up by one a scan.
        pub sequence: u64,
        /// Nearest range that the sensor can tell, meters.
        pub min_m: f64,
        /// Farthest range that the sensor can tell, meters.
        pub max_m: f64,
    }
}

/// Flag of a [`Beam`]: no echo came back within the range.
pub const NO_ECHO: u32 = 1;

item! {
    /// One direction of a range scan.
    pub struct Beam {
        /// Direction of the axis in the robot frame, radians, left positive.
        pub azimuth_rad: f64,
        /// Full opening angle, radians.
        pub cone_rad: f64,
        /// Distance from the sensor, meters; without meaning where [`NO_ECHO`] is set.
        pub range_m: f64,
        /// Position of the sensor in the robot frame, forward, meters.
        pub x_m: f64,
        /// Position of the sensor in the robot frame, left, meters.
        pub y_m: f64,
        /// [`NO_ECHO`] or zero.
        pub flags: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Beam {
    /// The range, where an echo came back; NaN is handed on for the reader to refuse.
    pub fn echo_m(&self) -> Option<f64> {
        (self.flags & NO_ECHO == 0).then_some(self.range_m)
    }
}

message! {
    /// Where the wheels say the robot is: odom frame, never jumps.
    "yamabico.Odometry.v1" Stream [u8]
    pub struct Odometry {
        /// When the encoders were read.
        pub stamp_ns: u64,
        /// Counts up by one a reading.
        pub sequence: u64,
        /// Forward from the start, meters.
        pub x: f64,
        /// Left from the start, meters.
        pub y: f64,
        /// Heading, radians, left positive, in (-pi, pi].
        pub theta: f64,
        /// Speed forward, m/s, robot frame.
        pub vx: f64,
        /// Speed to the left, m/s, robot frame.
        pub vy: f64,
        /// Turn rate, rad/s, left positive.
        pub omega: f64,
        /// Of (x, y, theta), row by row.
        pub covariance: [f64; 9],
    }
}

impl Odometry {
    /// A pose (odom frame) and how it moves (robot frame), without covariance.
    #[must_use]
    pub fn new(stamp_ns: u64, pose: &Pose2, twist: &Twist) -> Self {
        let Pose2 { x, y, theta } = *pose;
        let Twist { linear: vx, lateral: vy, angular: omega } = *twist;
        Self { stamp_ns, x, y, theta, vx, vy, omega, ..Self::default() }
    }
}

message! {
    /// Turn rates and accelerations in the robot frame.
    "yamabico.Imu.v1" Stream [u8]
    pub struct Imu {
        /// When it was read.
        pub stamp_ns: u64,
        /// Counts up by one a reading.
        pub sequence: u64,
        /// About x, y and z, rad/s.
        pub angular_velocity: [f64; 3],
        /// Along x, y and z, m/s^2, gravity included.
        pub linear_acceleration: [f64; 3],
        /// About x, radians; NaN where the device tells none.
        pub roll: f64,
        /// About y, radians, down positive; NaN where the device tells none.
        pub pitch: f64,
    }
}

message! {
    /// Which bumpers are pressed.
    "yamabico.Bumper.v1" Stream [u8]
    pub struct Bumper {
        /// When they were read.
        pub stamp_ns: u64,
        /// Counts up by one a reading.
        pub sequence: u64,
        /// A bit a bumper, lowest first.
        pub pressed: u64,
    }
}

message! {
    /// The time of a run whose clock is not the machine's.
    "yamabico.Clock.v1" Stream [u8] counted by step
    pub struct Clock {
        /// The instant that began.
        pub stamp_ns: u64,
        /// Counts up by one a step.
        pub step: u64,
    }
}

vocabulary! {
    /// What a turn of a step is for.
    pub enum TurnPhase {
        /// Everybody takes in what has arrived.
        Collect = 0 "collect",
        /// Everybody who has something new proposes.
        Propose = 1 "propose",
        /// The step is over: the driver obeys what was commanded, and goes on.
        Done = 2 "done",
    }
}

message! {
    /// A turn of a step of a run whose clock is not the machine's: the arbiter calls it, and whoever has taken it says so.
    "yamabico.Turn.v1" Stream [u8]
    pub struct Turn {
        /// The instant of the step.
        pub stamp_ns: u64,
        /// Counts up by one a turn called or taken.
        pub sequence: u64,
        /// That of the [`Clock`].
        pub step: u64,
        /// Who has taken it; empty where it is called.
        pub plugin: Name,
        /// A [`TurnPhase`] code.
        pub phase: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Turn {
    /// What it is for, where the code is known.
    pub fn phase(&self) -> Option<TurnPhase> {
        TurnPhase::from_code(self.phase)
    }
}

message! {
    /// What a simulator knows and no robot can: for judging a run only. No behavior may take it as an input.
    "yamabico.Truth.v1" Stream [u8]
    pub struct Truth {
        /// The instant that it describes.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Map frame, meters.
        pub x: f64,
        /// Map frame, meters.
        pub y: f64,
        /// Map frame, radians in (-pi, pi].
        pub theta: f64,
        /// Speed forward, m/s.
        pub vx: f64,
        /// Speed to the left, m/s.
        pub vy: f64,
        /// Turn rate, rad/s.
        pub omega: f64,
        /// Path length since the start, meters.
        pub distance_m: f64,
        /// From the footprint to the nearest thing, meters; negative inside it.
        pub clearance_m: f64,
        /// From the footprint to the nearest person, meters; infinite without people.
        pub person_m: f64,
        /// Times that the robot's own motion touched something.
        pub contacts: u32,
        /// Times that a person walked into the standing robot.
        pub struck: u32,
    }
}
