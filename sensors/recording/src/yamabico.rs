//! Measurements in recordings of this program: JSON, and images beside it.

use bytemuck::Pod;
use foxglove::Decode;
use foxglove::messages::{CameraCalibration, CompressedImage, FrameTransforms};
use serde_json::Value;
use yamabico_core::message::{
    Beam, Bumper, Encoding, FrameHeader, Imu, Message, MessageType, Odometry, RangeScanHeader,
};

use crate::measurement::{Measurement, Refusal, decode};
use crate::ros2::camera_info::{CalibratedCamera, calibrated};
use crate::ros2::transforms::Frames;

/// Name of the type of messages with the lens of a camera.
pub(crate) const CAMERA_CALIBRATION: &str = "foxglove.CameraCalibration";
/// Name of the type of messages with frames.
pub(crate) const FRAME_TRANSFORMS: &str = "foxglove.FrameTransforms";

/// Returns true if a topic with this type of message gives messages of the type `message`.
pub(crate) fn fits(schema: &str, message: &str) -> bool {
    schema == message
}

/// Topic of the images of the frames on `topic`.
pub(crate) fn image_topic(topic: &str) -> String {
    format!("/{}/image", topic.trim_start_matches('/'))
}

/// Converts the JSON of a message; a frame comes without its pixels.
pub(crate) fn measurement(schema: &str, data: &[u8]) -> Result<Measurement, Refusal> {
    let malformed = || Refusal::Malformed(format!("not a {schema}"));
    let json: Value = serde_json::from_slice(data).map_err(|error| Refusal::Malformed(error.to_string()))?;
    let kind = MessageType::find(schema).ok_or_else(malformed)?;
    let (header, items) = bytes(kind, &json).ok_or_else(malformed)?;
    let beams = || items.chunks_exact(size_of::<Beam>()).map(bytemuck::pod_read_unaligned).collect();
    let measurement = match schema {
        FrameHeader::NAME => pod(&header).map(|header| Measurement::Frame(header, Vec::new())),
        RangeScanHeader::NAME => pod(&header).map(|header| Measurement::Scan(header, beams())),
        Odometry::NAME => pod(&header).map(Measurement::Odometry),
        Imu::NAME => pod(&header).map(Measurement::Imu),
        Bumper::NAME => pod(&header).map(Measurement::Bumper),
        _ => None,
    };
    measurement.ok_or_else(malformed)
}

/// Converts the image of a frame.
pub(crate) fn image(header: &FrameHeader, data: &[u8]) -> Result<Measurement, Refusal> {
    let malformed = |what: &str| Refusal::Malformed(what.to_owned());
    let image = CompressedImage::decode(data).map_err(|error| malformed(&error.to_string()))?;
    let image = decode(&image.data)?;
    if (image.width(), image.height()) != (header.width, header.height) {
        return Err(malformed("an image of another size than its header"));
    }
    let encoding = header.encoding().ok_or_else(|| malformed("an unknown encoding"))?;
    let pixels = match encoding {
        Encoding::Gray8 => image.into_luma8().into_raw(),
        Encoding::Rgb8 => image.into_rgb8().into_raw(),
    };
    let stride = header.width * encoding.bytes_per_pixel();
    Ok(Measurement::Frame(FrameHeader { stride, ..*header }, pixels))
}

/// Converts the lens of a camera; its frame is the topic of the camera.
pub(crate) fn calibration(data: &[u8]) -> Result<CalibratedCamera, Refusal> {
    let lens = CameraCalibration::decode(data).map_err(|error| Refusal::Malformed(error.to_string()))?;
    calibrated(lens.frame_id, [lens.width, lens.height], &lens.distortion_model, &lens.d, &lens.k)
}

/// Adds the transforms of a message to `frames`.
pub(crate) fn add_frames(frames: &mut Frames, data: &[u8]) -> Result<(), Refusal> {
    let message = FrameTransforms::decode(data).map_err(|error| Refusal::Malformed(error.to_string()))?;
    for transform in &message.transforms {
        let (Some(t), Some(q)) = (&transform.translation, &transform.rotation) else { continue };
        let (child, parent) = (&transform.child_frame_id, &transform.parent_frame_id);
        frames.insert(child, parent, [t.x, t.y, t.z], [q.x, q.y, q.z, q.w])?;
    }
    Ok(())
}

/// Bytes of a message: from its fields, or as they are if a number is not finite.
fn bytes(kind: &MessageType, json: &Value) -> Option<(Vec<u8>, Vec<u8>)> {
    let raw = |name: &str| {
        let digits: Option<Vec<u32>> =
            json.get(name)?.as_str()?.chars().map(|digit| digit.to_digit(16)).collect();
        Some(digits?.chunks_exact(2).map(|pair| (pair[0] * 16 + pair[1]) as u8).collect::<Vec<u8>>())
    };
    match raw("header_hex") {
        Some(header) => Some((header, raw("items_hex")?)),
        None => kind.from_json(json),
    }
}

fn pod<T: Pod>(bytes: &[u8]) -> Option<T> {
    bytemuck::try_pod_read_unaligned(bytes).ok()
}
