//! Calibration of a camera, for programs that draw a scene over its picture.

use foxglove::messages::CameraCalibration;
use yamabico_core::sensor::SensorKind;

use super::frames::timestamp;

/// Converts the lens of the camera with the frame `frame_id`; `None` for a sensor that is no pinhole camera.
pub(super) fn calibration(stamp_ns: u64, frame_id: &str, sensor: &SensorKind) -> Option<CameraCalibration> {
    let SensorKind::Camera { intrinsics: lens, distortion, .. } = sensor else { return None };
    Some(CameraCalibration {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame_id.to_owned(),
        width: lens.width,
        height: lens.height,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![distortion.k1, distortion.k2, distortion.p1, distortion.p2, distortion.k3],
        k: vec![lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![lens.fx, 0.0, lens.cx, 0.0, 0.0, lens.fy, lens.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    })
}
