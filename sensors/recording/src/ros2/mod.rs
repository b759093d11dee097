//! Measurements in recordings of ROS 2: CDR messages of `sensor_msgs`, `nav_msgs` and a few more.
//!
//! | file | messages |
//! |---|---|
//! | `image` | CompressedImage, Image |
//! | `range` | LaserScan, Range |
//! | `motion` | Odometry, Imu, JointState |
//! | `bumper` | Bool, HazardDetectionVector of a Create 3, Bump of a Neato |
//! | `camera_info` | CameraInfo |
//! | `transforms` | TFMessage: the frames of the robot |

mod bumper;
pub mod camera_info;
mod image;
mod motion;
mod range;
pub mod transforms;

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::from_bytes;
use serde::Deserialize;
use yamabico_core::message::{Bumper, FrameHeader, Imu, Message, Odometry, RangeScanHeader};

use crate::measurement::{Measurement, Refusal};

pub use motion::{twist, twist_stamped};

/// Longest delay between a stamp and its recording, ns; with a longer one, the stamp is of another clock.
pub(crate) const MAX_LATENCY_NS: u64 = 2_000_000_000;

/// Types of ROS 2 that give messages of the type `message`.
#[must_use]
pub fn types(message: &str) -> &'static [&'static str] {
    match message {
        FrameHeader::NAME => &["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"],
        RangeScanHeader::NAME => &["sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Range"],
        Odometry::NAME => &["nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState"],
        Imu::NAME => &["sensor_msgs/msg/Imu"],
        Bumper::NAME => &[
            "std_msgs/msg/Bool",
            "irobot_create_msgs/msg/HazardDetectionVector",
            "neato2_interfaces/msg/Bump",
        ],
        _ => &[],
    }
}

/// Returns true if a topic with this type of message gives messages of the type `message`.
pub(crate) fn fits(schema: &str, message: &str) -> bool {
    types(message).contains(&schema)
}

/// Description of what is expected for messages of the type `message`.
#[must_use]
pub fn expected(message: &str) -> &'static str {
    match message {
        FrameHeader::NAME => "images (CompressedImage or Image)",
        RangeScanHeader::NAME => "range scans (LaserScan or Range)",
        Odometry::NAME => "odometry (Odometry, or JointState of the wheels)",
        Bumper::NAME => "bumpers (Bool, HazardDetectionVector or Bump)",
        _ => "inertial measurements",
    }
}

/// Converts a CDR message.
///
/// # Errors
/// [`Refusal`].
pub fn measurement(schema: &str, data: &[u8]) -> Result<Measurement, Refusal> {
    match schema {
        "sensor_msgs/msg/CompressedImage" => image::compressed(&read(data)?),
        "sensor_msgs/msg/Image" => image::raw(&read(data)?),
        "sensor_msgs/msg/LaserScan" => range::scan(&read(data)?),
        "sensor_msgs/msg/Range" => range::range(&read(data)?),
        "nav_msgs/msg/Odometry" => motion::odometry(&read(data)?),
        "sensor_msgs/msg/Imu" => motion::imu(&read(data)?),
        "sensor_msgs/msg/JointState" => motion::joints(read(data)?),
        "std_msgs/msg/Bool" => bumper::contact(&read(data)?),
        "irobot_create_msgs/msg/HazardDetectionVector" => bumper::hazards(&read(data)?),
        "neato2_interfaces/msg/Bump" => bumper::neato(&read(data)?),
        other => Err(Refusal::Malformed(format!("`{other}` is not supported"))),
    }
}

/// Reads a message behind its encapsulation header, in either byte order.
pub(crate) fn read<'a, T: Deserialize<'a>>(data: &'a [u8]) -> Result<T, Refusal> {
    let malformed = |what: String| Refusal::Malformed(what);
    let (header, body) =
        data.split_at_checked(4).ok_or_else(|| malformed("shorter than its header".into()))?;
    let decoded = match header[1] {
        0 => from_bytes::<T, BigEndian>(body),
        1 => from_bytes::<T, LittleEndian>(body),
        other => return Err(malformed(format!("CDR in the representation {other}"))),
    };
    decoded.map(|(message, _)| message).map_err(|error| malformed(error.to_string()))
}

/// Refuses numbers that are not finite.
fn finite(numbers: &[f64], what: &str) -> Result<(), Refusal> {
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(()),
        false => Err(Refusal::Malformed(format!("{what} that is not finite"))),
    }
}

#[derive(Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

impl Stamp {
    fn ns(&self) -> u64 {
        u64::try_from(self.sec).unwrap_or(0) * 1_000_000_000 + u64::from(self.nanosec)
    }
}

/// Head of most messages.
#[derive(Deserialize)]
struct Header {
    stamp: Stamp,
    frame_id: String,
}

impl Header {
    fn stamp_ns(&self) -> u64 {
        self.stamp.ns()
    }
}

/// Reads a `std_msgs/msg/Bool`.
///
/// # Errors
/// [`Refusal`].
pub fn flag(data: &[u8]) -> Result<bool, Refusal> {
    read::<bumper::Bool>(data).map(|message| message.is_true())
}

/// Reads a `rosgraph_msgs/msg/Clock`, ns.
///
/// # Errors
/// [`Refusal`].
pub fn clock(data: &[u8]) -> Result<u64, Refusal> {
    read::<Stamp>(data).map(|stamp| stamp.ns())
}

/// Returns the frame in which the message of a sensor is; `None` for a message without a header, or a malformed one.
#[must_use]
pub fn frame_id(data: &[u8]) -> Option<String> {
    read::<Header>(data).ok().map(|header| header.frame_id)
}

#[derive(Clone, Copy, Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}
