//! Measurements in recordings of ROS 2: CDR messages of `sensor_msgs` and `nav_msgs`.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::from_bytes;
use serde::Deserialize;
use yamabico_core::message::{
    Beam, Encoding, FrameHeader, Imu as ImuReading, Message, NO_ECHO, Odometry as OdometryReading,
    RangeScanHeader,
};

use crate::MAX_BEAMS;
use crate::measurement::{Measurement, Refusal, decode};

/// Longest delay between a stamp and its recording, ns; with a longer one, the stamp is of another clock.
pub(crate) const MAX_LATENCY_NS: u64 = 2_000_000_000;

/// Types of ROS 2 that give messages of the type `message`.
fn types(message: &str) -> &'static [&'static str] {
    match message {
        FrameHeader::NAME => &["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"],
        RangeScanHeader::NAME => &["sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Range"],
        OdometryReading::NAME => &["nav_msgs/msg/Odometry"],
        ImuReading::NAME => &["sensor_msgs/msg/Imu"],
        _ => &[],
    }
}

/// Returns true if a topic with this type of message gives messages of the type `message`.
pub(crate) fn fits(schema: &str, message: &str) -> bool {
    types(message).contains(&schema)
}

/// Description of what is expected for messages of the type `message`.
pub(crate) fn expected(message: &str) -> &'static str {
    match message {
        FrameHeader::NAME => "images (CompressedImage or Image)",
        RangeScanHeader::NAME => "range scans (LaserScan or Range)",
        OdometryReading::NAME => "odometry",
        _ => "inertial measurements",
    }
}

/// Converts a CDR message.
pub(crate) fn measurement(schema: &str, data: &[u8]) -> Result<Measurement, Refusal> {
    match schema {
        "sensor_msgs/msg/CompressedImage" => compressed(&read(data)?),
        "sensor_msgs/msg/Image" => raw(&read(data)?),
        "sensor_msgs/msg/LaserScan" => scan(&read(data)?),
        "sensor_msgs/msg/Range" => Ok(range(&read(data)?)),
        "nav_msgs/msg/Odometry" => odometry(&read(data)?),
        "sensor_msgs/msg/Imu" => Ok(imu(&read(data)?)),
        other => Err(Refusal::Malformed(format!("`{other}` is not supported"))),
    }
}

/// Reads a message behind its encapsulation header, in either byte order.
fn read<'a, T: Deserialize<'a>>(data: &'a [u8]) -> Result<T, Refusal> {
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

#[derive(Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Deserialize)]
struct Header<'a> {
    stamp: Stamp,
    #[serde(borrow)]
    _frame_id: &'a str,
}

impl Header<'_> {
    fn stamp_ns(&self) -> u64 {
        let seconds = u64::try_from(self.stamp.sec).unwrap_or(0);
        seconds * 1_000_000_000 + u64::from(self.stamp.nanosec)
    }
}

#[derive(Deserialize)]
struct CompressedImage<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    #[serde(borrow)]
    _format: &'a str,
    #[serde(borrow)]
    data: &'a [u8],
}

fn compressed(message: &CompressedImage<'_>) -> Result<Measurement, Refusal> {
    let image = decode(message.data)?;
    let (width, height) = (image.width(), image.height());
    Ok(gray(&message.header, width, height, image.into_luma8().into_raw()))
}

#[derive(Deserialize)]
struct Image<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    height: u32,
    width: u32,
    #[serde(borrow)]
    encoding: &'a str,
    _is_bigendian: u8,
    step: u32,
    #[serde(borrow)]
    data: &'a [u8],
}

fn raw(message: &Image<'_>) -> Result<Measurement, Refusal> {
    let bytes = match message.encoding {
        "mono8" => 1,
        "rgb8" | "bgr8" => 3,
        other => return Err(Refusal::Encoding(other.to_owned())),
    };
    let malformed = || Refusal::Malformed(format!("an image of {}x{} pixels", message.width, message.height));
    let (width, step) = (message.width as usize, message.step as usize);
    let row = width.checked_mul(bytes).filter(|row| *row > 0 && *row <= step).ok_or_else(malformed)?;
    let size = step.checked_mul(message.height as usize).filter(|size| *size <= message.data.len());
    let data = &message.data[..size.ok_or_else(malformed)?];
    // Gray by the weights of ITU-R BT.601, in 256ths.
    let weights = if message.encoding == "bgr8" { [29, 150, 77] } else { [77, 150, 29] };
    let luma = |pixel: &[u8]| match pixel {
        [gray] => *gray,
        _ => {
            let sum: u32 = pixel.iter().zip(weights).map(|(value, weight)| u32::from(*value) * weight).sum();
            (sum >> 8) as u8
        }
    };
    let pixels = data.chunks_exact(step).flat_map(|line| line[..row].chunks_exact(bytes).map(luma)).collect();
    Ok(gray(&message.header, message.width, message.height, pixels))
}

fn gray(header: &Header<'_>, width: u32, height: u32, pixels: Vec<u8>) -> Measurement {
    let encoding = Encoding::Gray8.code();
    let stamp_ns = header.stamp_ns();
    let frame = FrameHeader { stamp_ns, width, height, stride: width, encoding, exposure: 1.0, sequence: 0 };
    Measurement::Frame(frame, pixels)
}

#[derive(Deserialize)]
struct LaserScan<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    angle_min: f32,
    _angle_max: f32,
    angle_increment: f32,
    _time_increment: f32,
    _scan_time: f32,
    range_min: f32,
    range_max: f32,
    ranges: Vec<f32>,
}

fn scan(message: &LaserScan<'_>) -> Result<Measurement, Refusal> {
    let angles = [message.angle_min, message.angle_increment, message.range_min, message.range_max];
    if !angles.iter().all(|number| number.is_finite()) || message.ranges.len() > MAX_BEAMS {
        return Err(Refusal::Malformed(format!("a scan of {} ranges", message.ranges.len())));
    }
    let (min_m, max_m) = (f64::from(message.range_min), f64::from(message.range_max));
    let beam = |(i, range): (usize, &f32)| {
        let range_m = f64::from(*range);
        let has_echo = range_m.is_finite() && (min_m..=max_m).contains(&range_m);
        let azimuth_rad = f64::from(message.angle_min) + i as f64 * f64::from(message.angle_increment);
        Beam {
            azimuth_rad: azimuth_rad.sin().atan2(azimuth_rad.cos()),
            cone_rad: f64::from(message.angle_increment).abs(),
            range_m: if has_echo { range_m } else { max_m },
            flags: if has_echo { 0 } else { NO_ECHO },
            ..Beam::default()
        }
    };
    let beams = message.ranges.iter().enumerate().map(beam).collect();
    let header = RangeScanHeader { stamp_ns: message.header.stamp_ns(), sequence: 0, min_m, max_m };
    Ok(Measurement::Scan(header, beams))
}

#[derive(Deserialize)]
struct Range<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    _radiation_type: u8,
    field_of_view: f32,
    min_range: f32,
    max_range: f32,
    range: f32,
}

fn range(message: &Range<'_>) -> Measurement {
    let (min_m, max_m, range_m) =
        (f64::from(message.min_range), f64::from(message.max_range), f64::from(message.range));
    let has_echo = range_m.is_finite() && (min_m..=max_m).contains(&range_m);
    let beam = Beam {
        cone_rad: f64::from(message.field_of_view),
        range_m: if has_echo { range_m } else { max_m },
        flags: if has_echo { 0 } else { NO_ECHO },
        ..Beam::default()
    };
    let header = RangeScanHeader { stamp_ns: message.header.stamp_ns(), sequence: 0, min_m, max_m };
    Measurement::Scan(header, vec![beam])
}

#[derive(Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Deserialize)]
struct Odometry<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    #[serde(borrow)]
    _child_frame_id: &'a str,
    position: Vector,
    orientation: Quaternion,
    /// 6x6; serde has no arrays of 36.
    pose_covariance: [[f64; 18]; 2],
    linear: Vector,
    angular: Vector,
}

fn odometry(message: &Odometry<'_>) -> Result<Measurement, Refusal> {
    let Quaternion { x, y, z, w } = message.orientation;
    let theta = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    // Rows and columns x, y and yaw of a 6x6 matrix.
    let all: Vec<f64> = message.pose_covariance.iter().flatten().copied().collect();
    let mut covariance = [0.0; 9];
    for (i, row) in [0, 1, 5].into_iter().enumerate() {
        for (j, column) in [0, 1, 5].into_iter().enumerate() {
            covariance[3 * i + j] = all[6 * row + column];
        }
    }
    let odometry = OdometryReading {
        stamp_ns: message.header.stamp_ns(),
        sequence: 0,
        x: message.position.x,
        y: message.position.y,
        theta,
        vx: message.linear.x,
        vy: message.linear.y,
        omega: message.angular.z,
        covariance,
    };
    let numbers = [odometry.x, odometry.y, odometry.theta, odometry.vx, odometry.vy, odometry.omega];
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(Measurement::Odometry(odometry)),
        false => Err(Refusal::Malformed("odometry that is not finite".to_owned())),
    }
}

#[derive(Deserialize)]
struct Imu<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    _orientation: Quaternion,
    _orientation_covariance: [f64; 9],
    angular_velocity: Vector,
    _angular_velocity_covariance: [f64; 9],
    linear_acceleration: Vector,
    _linear_acceleration_covariance: [f64; 9],
}

fn imu(message: &Imu<'_>) -> Measurement {
    let array = |vector: &Vector| [vector.x, vector.y, vector.z];
    Measurement::Imu(ImuReading {
        stamp_ns: message.header.stamp_ns(),
        angular_velocity: array(&message.angular_velocity),
        linear_acceleration: array(&message.linear_acceleration),
        roll: f64::NAN,
        pitch: f64::NAN,
        sequence: 0,
    })
}
