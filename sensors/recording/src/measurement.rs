//! A recorded measurement, whatever file it comes from.

use yamabico_core::message::{Beam, Bumper, FrameHeader, Imu, Odometry, RangeScanHeader};

/// A measurement with the stamp of its sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Measurement {
    /// An image: header and pixels.
    Frame(FrameHeader, Vec<u8>),
    /// A range scan: header and beams.
    Scan(RangeScanHeader, Vec<Beam>),
    /// Odometry.
    Odometry(Odometry),
    /// Inertial measurement.
    Imu(Imu),
    /// State of bumpers.
    Bumper(Bumper),
    /// Angles of joints.
    Joints {
        /// Time of the measurement, ns.
        stamp_ns: u64,
        /// Name and angle (rad) of each joint.
        angles: Vec<(String, f64)>,
    },
}

impl Measurement {
    /// Stamp of the measurement, ns on the clock of the recording.
    #[must_use]
    pub fn stamp_ns(&self) -> u64 {
        match self {
            Measurement::Frame(header, _) => header.stamp_ns,
            Measurement::Scan(header, _) => header.stamp_ns,
            Measurement::Odometry(header) => header.stamp_ns,
            Measurement::Imu(header) => header.stamp_ns,
            Measurement::Bumper(header) => header.stamp_ns,
            Measurement::Joints { stamp_ns, .. } => *stamp_ns,
        }
    }
}

/// Cause why a message is left out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The message contradicts itself, is cut, or holds numbers that are not finite.
    #[error("malformed: {0}")]
    Malformed(String),
    /// The encoding of an image is not supported.
    #[error("an image in `{0}`: use PNG, JPEG, mono8, rgb8, bgr8 or yuv422")]
    Encoding(String),
    /// The camera has a model that is not supported.
    #[error("a camera with {0}: its images must be rectified, or calibrated anew as `plumb_bob`")]
    CameraModel(String),
}

/// Maximum size of an image, bytes; a larger one is left out.
const MAX_PIXEL_BYTES: usize = 128 << 20;

/// Decodes a PNG or JPEG image; its size is checked before memory is reserved.
pub(crate) fn decode(data: &[u8]) -> Result<image::DynamicImage, Refusal> {
    let malformed = |error: &dyn std::fmt::Display| Refusal::Malformed(error.to_string());
    let reader = || {
        let reader = image::ImageReader::new(std::io::Cursor::new(data)).with_guessed_format();
        reader.map_err(|error| malformed(&error))
    };
    let (width, height) = reader()?.into_dimensions().map_err(|error| malformed(&error))?;
    if 3 * u64::from(width) * u64::from(height) > MAX_PIXEL_BYTES as u64 {
        return Err(Refusal::Malformed(format!("an image of {width}x{height} pixels")));
    }
    reader()?.decode().map_err(|error| malformed(&error))
}
