//! Parameters that the cameras of all kinds share.

use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};
use yamabico_core::message::{Encoding, FrameHeader, Message};
use yamabico_core::sensor::{SensorInfo, SensorKind};

/// Parameters that the cameras of all kinds share: they decide the description of the sensor and the headers of its frames.
#[derive(Clone, Debug)]
pub struct CameraDescription {
    /// Nominal frame rate, Hz.
    pub rate_hz: f64,
    /// Delay from the middle of the exposure to the arrival of a frame, ms.
    pub latency_ms: f64,
    /// Pixel format.
    pub encoding: Encoding,
    /// Image size, focal length and principal point.
    pub intrinsics: IntrinsicsConfig,
    /// Accuracy of intrinsics and mount.
    pub calibration: Calibration,
    /// Pose on the robot.
    pub mount: MountConfig,
}

impl CameraDescription {
    /// Returns the description of the sensor.
    ///
    /// # Errors
    /// Invalid intrinsics.
    pub fn info(&self, name: &str) -> Result<SensorInfo, ParameterError> {
        Ok(SensorInfo {
            name: name.to_owned(),
            message: FrameHeader::NAME,
            period_s: 1.0 / self.rate_hz,
            latency_s: 1e-3 * self.latency_ms,
            kind: SensorKind::camera(&self.intrinsics, self.mount, self.calibration)?,
        })
    }

    /// Returns width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.intrinsics.width, self.intrinsics.height]
    }

    /// Returns the size of one image, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let [width, height] = self.size().map(|side| side as usize);
        width * height * self.encoding.bytes_per_pixel() as usize
    }

    /// Returns the header of a frame.
    #[must_use]
    pub fn header(&self, stamp_ns: u64, sequence: u64) -> FrameHeader {
        FrameHeader { stamp_ns, sequence, ..FrameHeader::new(self.encoding, self.size()) }
    }
}
