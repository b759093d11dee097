//! Intrinsics of cameras, from `sensor_msgs/msg/CameraInfo`.

use serde::Deserialize;
use yamabico_core::camera::{Distortion, Intrinsics};

use super::{Header, finite, read};
use crate::measurement::Refusal;

/// Name of the message type.
pub const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";

#[derive(Deserialize)]
struct CameraInfo {
    header: Header,
    height: u32,
    width: u32,
    distortion_model: String,
    d: Vec<f64>,
    k: [f64; 9],
    _r: [f64; 9],
    _p: [f64; 12],
    binning: [u32; 2],
    region: [u32; 4],
    _do_rectify: u8,
}

/// Calibration of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedCamera {
    /// Optical frame.
    pub frame_id: String,
    /// Image size, focal lengths and principal point, pixels.
    pub intrinsics: Intrinsics,
    /// Lens distortion.
    pub distortion: Distortion,
}

/// Converts a CDR message.
///
/// # Errors
/// [`Refusal::CameraModel`] for a distortion other than `plumb_bob`, and for images that are scaled or cut.
pub fn camera_info(data: &[u8]) -> Result<CalibratedCamera, Refusal> {
    let message: CameraInfo = read(data)?;
    let is_cut = message.region != [0; 4] && message.region[2..] != [message.height, message.width];
    if message.binning.iter().any(|binning| *binning > 1) || is_cut {
        return Err(Refusal::CameraModel("images that are scaled or cut (binning, roi)".to_owned()));
    }
    let CameraInfo { header, width, height, distortion_model, d, k, .. } = message;
    calibrated(header.frame_id, [width, height], &distortion_model, &d, &k)
}

/// Camera with this optical frame, image size, model of the distortion with its coefficients, and camera matrix.
///
/// # Errors
/// [`Refusal::CameraModel`] for a distortion other than `plumb_bob`; a malformed matrix.
pub(crate) fn calibrated(
    frame_id: String,
    [width, height]: [u32; 2],
    model: &str,
    d: &[f64],
    k: &[f64],
) -> Result<CalibratedCamera, Refusal> {
    let refused = |what: &str| Err(Refusal::CameraModel(what.to_owned()));
    let &[fx, _, cx, _, fy, cy, ..] = k else {
        return Err(Refusal::Malformed("a camera without its matrix".to_owned()));
    };
    finite(&[fx, fy, cx, cy], "a camera matrix")?;
    finite(d, "a distortion")?;
    let distortion = match (model, d) {
        ("" | "plumb_bob", d) if d.iter().all(|k| *k == 0.0) => Distortion::NONE,
        ("plumb_bob", &[k1, k2, p1, p2, k3]) => Distortion { k1, k2, p1, p2, k3 },
        ("plumb_bob", d) => return refused(&format!("plumb_bob with {} coefficients", d.len())),
        (model, _) => return refused(model),
    };
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    if !intrinsics.is_valid() {
        return Err(Refusal::Malformed("an uncalibrated camera: its matrix is empty".to_owned()));
    }
    Ok(CalibratedCamera { frame_id, intrinsics, distortion })
}
