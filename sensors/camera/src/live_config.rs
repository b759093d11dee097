//! Parameters that all live cameras share.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};
use yamabico_core::message::{Encoding, FrameHeader, Message};
use yamabico_core::sensor::{SensorInfo, SensorKind};

/// Pixel format that a camera publishes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PixelFormat {
    /// A gray level.
    #[default]
    Gray8,
    /// Red, green and blue.
    Rgb8,
}

impl PixelFormat {
    /// Returns the format in messages.
    #[must_use]
    pub fn encoding(self) -> Encoding {
        match self {
            PixelFormat::Gray8 => Encoding::Gray8,
            PixelFormat::Rgb8 => Encoding::Rgb8,
        }
    }
}

/// View of a live camera: what behaviors and frames need of its parameters.
#[derive(Clone, Debug)]
pub struct LiveView {
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

impl LiveView {
    /// Returns the description of the sensor.
    ///
    /// # Errors
    /// Invalid intrinsics.
    pub fn info(&self, name: &str) -> Result<SensorInfo, ParameterError> {
        if !self.intrinsics.intrinsics().is_valid() {
            return Err(ParameterError::new("intrinsics", "width, height and focal lengths must be above 0"));
        }
        Ok(SensorInfo {
            name: name.to_owned(),
            message: FrameHeader::NAME,
            period_s: 1.0 / self.rate_hz,
            latency_s: 1e-3 * self.latency_ms,
            kind: SensorKind::Camera {
                intrinsics: self.intrinsics.intrinsics(),
                distortion: self.intrinsics.distortion,
                mount: self.mount.into(),
                calibrated: self.calibration,
            },
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
        let [width, height] = self.size();
        let stride = width * self.encoding.bytes_per_pixel();
        FrameHeader {
            stamp_ns,
            sequence,
            width,
            height,
            stride,
            encoding: self.encoding.code(),
            exposure: 1.0,
        }
    }
}

/// Declares the parameters of a live camera: its own, and those that all share.
macro_rules! live_camera {
    ($(#[$meta:meta])* pub struct $name:ident { $($own:tt)* }) => {
        $(#[$meta])*
        #[serde_inline_default::serde_inline_default]
        #[derive(Clone, Debug, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($own)*
            /// Rate at which the camera is expected to send; the sensor counts as dead after three missing frames.
            #[serde_inline_default(30.0)]
            #[schemars(range(min = 0.1, max = 1000.0))]
            pub rate_hz: f64,
            /// Delay from the middle of the exposure to the arrival of a frame; frames are stamped that much earlier.
            #[serde_inline_default(50.0)]
            #[schemars(range(min = 0.0, max = 2000.0))]
            pub latency_ms: f64,
            /// Pixel format that is published: `gray8` is faster, `rgb8` is for behaviors that look at colors.
            #[serde(default)]
            pub encoding: crate::live_config::PixelFormat,
            /// Image size, focal length and principal point; images of another size are refused.
            pub intrinsics: yamabico_core::camera::IntrinsicsConfig,
            /// Accuracy of intrinsics and mount. If guessed, behaviors treat directions as approximate and do not use
            /// distances.
            #[serde_inline_default(yamabico_core::camera::Calibration::Guessed)]
            pub calibration: yamabico_core::camera::Calibration,
            /// Pose on the robot.
            pub mount: yamabico_core::camera::MountConfig,
        }

        impl $name {
            /// Returns the parameters that all live cameras share.
            #[must_use]
            pub fn view(&self) -> crate::live_config::LiveView {
                crate::live_config::LiveView {
                    rate_hz: self.rate_hz,
                    latency_ms: self.latency_ms,
                    encoding: self.encoding.encoding(),
                    intrinsics: self.intrinsics,
                    calibration: self.calibration,
                    mount: self.mount,
                }
            }
        }
    };
}

pub(crate) use live_camera;
