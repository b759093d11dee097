//! The simulated camera as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;
use yamabico_core::camera::{Calibration, Distortion, IntrinsicsConfig, MountConfig};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::FrameHeader;
use yamabico_core::sensor::{SensorInfo, SensorKind};

use super::Beat;
use super::pictures::{self, Painter, Pictures, PixelFormat, latency_ms, period_ms};
use crate::Scene;
use crate::render::{CameraView, Photometry, RenderError, Renderer};
use crate::simulation::Simulation;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Time from one picture to the next, ms, 5 to 10000.
    #[serde(default = "period_ms")]
    #[schemars(range(min = 5.0, max = 10000.0))]
    pub period_ms: f64,
    /// Time from the exposure to the picture's arrival, ms, 0 to 15000: the robot moves on meanwhile.
    #[serde(default = "latency_ms")]
    #[schemars(range(min = 0.0, max = 15000.0))]
    pub latency_ms: f64,
    /// What a pixel holds.
    #[serde(default)]
    pub encoding: PixelFormat,
    /// Size and focal length; a distortion is refused.
    pub intrinsics: IntrinsicsConfig,
    /// Where it sits on the robot.
    pub mount: MountConfig,
    /// Exposure, vignetting and noise.
    #[serde(default)]
    pub photometry: Photometry,
}

impl CameraConfig {
    /// What behaviors are told.
    ///
    /// # Errors
    /// A lens with distortion, which is not drawn.
    pub fn info(&self, name: &str) -> Result<SensorInfo, BuildError> {
        if self.intrinsics.distortion != Distortion::NONE {
            return Err(BuildError::new(
                "intrinsics.distortion",
                "the simulator draws no distortion: leave it out",
            ));
        }
        if !self.intrinsics.intrinsics().is_valid() {
            return Err(BuildError::new("intrinsics", "width, height and focal lengths must be above 0"));
        }
        let kind = SensorKind::Camera {
            intrinsics: self.intrinsics.intrinsics(),
            distortion: Distortion::NONE,
            mount: self.mount.into(),
            calibrated: Calibration::Measured,
        };
        Ok(super::info::<FrameHeader>(name, self.period_ms, self.latency_ms, kind))
    }

    /// Bytes of one picture.
    #[must_use]
    pub fn bytes(&self) -> usize {
        pictures::bytes(&self.header())
    }

    fn header(&self) -> FrameHeader {
        self.encoding.header([self.intrinsics.width, self.intrinsics.height], &self.photometry)
    }
}

/// The lens, and where it looks.
pub struct Lens {
    config: CameraConfig,
    renderer: Renderer,
}

/// The camera called `name`; `seed` gives its noise.
pub fn camera(
    name: &str,
    config: CameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    seed: u64,
) -> Pictures<Lens> {
    let renderer = Renderer::new(config.photometry, crate::random::stream(seed, name));
    Pictures {
        name: name.to_owned(),
        simulation,
        painter: Lens { config, renderer },
        format: config.encoding,
        header: config.header(),
        beat: Beat::new(config.period_ms, config.latency_ms),
    }
}

impl Painter for Lens {
    fn paint(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        _: u64,
        format: PixelFormat,
        pixels: &mut [u8],
    ) -> Result<(), RenderError> {
        let intrinsics = self.config.intrinsics.intrinsics();
        let view = CameraView { intrinsics, mount: self.config.mount.into(), robot };
        match format {
            PixelFormat::Gray8 => self.renderer.render(scene, &view, pixels),
            PixelFormat::Rgb8 => self.renderer.render_rgb(scene, &view, pixels),
        }
    }
}
