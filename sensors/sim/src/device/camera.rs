//! Pinhole camera, as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::{Calibration, Distortion, IntrinsicsConfig, MountConfig};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{SensorInfo, SensorKind};

use super::Schedule;
use super::frames::{self, FrameSensor, ImageRenderer, Losses};
use crate::Scene;
use crate::render::{CameraView, Photometry, RenderError, Renderer};
use crate::simulation::Simulation;

/// Parameters of a pinhole camera.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Period of the frames.
    #[serde_inline_default(100.0)]
    #[schemars(range(min = 5.0, max = 10000.0))]
    pub period_ms: f64,
    /// Delay from the exposure to the delivery of a frame; the robot moves on in the meantime.
    #[serde_inline_default(30.0)]
    #[schemars(range(min = 0.0, max = 15000.0))]
    pub latency_ms: f64,
    /// Fraction of frames that are lost.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Pixel format.
    #[serde(default)]
    pub encoding: Encoding,
    /// Image size, focal length and principal point; distortion is not supported.
    pub intrinsics: IntrinsicsConfig,
    /// Pose on the robot.
    pub mount: MountConfig,
    /// Exposure, vignetting, noise, blur and glare.
    #[serde(default)]
    pub photometry: Photometry,
}

impl CameraConfig {
    /// Returns the description of the sensor.
    ///
    /// # Errors
    /// A distorted lens, which the simulator does not support, or invalid intrinsics.
    pub fn info(&self, name: &str) -> Result<SensorInfo, ParameterError> {
        if self.intrinsics.distortion != Distortion::NONE {
            return Err(ParameterError::new(
                "intrinsics.distortion",
                "is not supported by the simulator: remove it",
            ));
        }
        let kind = SensorKind::camera(&self.intrinsics, self.mount, Calibration::Measured)?;
        Ok(super::info::<FrameHeader>(name, self.period_ms, self.latency_ms, kind))
    }

    /// Returns the size of one image, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        frames::frame_bytes(&self.header())
    }

    fn header(&self) -> FrameHeader {
        frames::header(self.encoding, [self.intrinsics.width, self.intrinsics.height], &self.photometry)
    }
}

/// Renderer of a pinhole camera.
pub struct PinholeRenderer {
    config: CameraConfig,
    renderer: Renderer,
}

/// Returns the camera sensor `name`, with noise from `seed`.
pub fn camera_sensor(
    name: &str,
    config: CameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    seed: u64,
) -> FrameSensor<PinholeRenderer> {
    let renderer = Renderer::new(config.photometry, crate::random::stream(seed, name));
    FrameSensor {
        name: name.to_owned(),
        simulation,
        renderer: PinholeRenderer { config, renderer },
        encoding: config.encoding,
        header: config.header(),
        schedule: Schedule::new(config.period_ms, config.latency_ms),
        losses: Losses { share: config.dropout, seed },
    }
}

impl ImageRenderer for PinholeRenderer {
    fn render(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        _: u64,
        encoding: Encoding,
        pixels: &mut [u8],
    ) -> Result<(), RenderError> {
        let intrinsics = self.config.intrinsics.intrinsics();
        let view = CameraView { intrinsics, mount: self.config.mount.into(), robot };
        match encoding {
            Encoding::Gray8 => self.renderer.render(scene, &view, pixels),
            Encoding::Rgb8 => self.renderer.render_rgb(scene, &view, pixels),
        }
    }
}
