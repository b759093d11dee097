//! Omnidirectional mirror camera, as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{Calibration, MirrorCamera, MirrorConfig, MirrorImageConfig, Mount, MountConfig};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{SensorInfo, SensorKind};

use super::Schedule;
use super::frames::{self, FrameSensor, ImageRenderer, Losses};
use super::sway::{Sway, SwayConfig};
use crate::Scene;
use crate::render::{MirrorRenderer, MirrorView, Photometry, RenderError};
use crate::simulation::Simulation;

/// Parameters of an omnidirectional camera with a mirror.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorCameraConfig {
    /// Period of the frames.
    #[serde_inline_default(100.0)]
    #[schemars(range(min = 5.0, max = 10000.0))]
    pub period_ms: f64,
    /// Delay from the exposure to the delivery of a frame; the robot moves on in the meantime.
    #[serde_inline_default(30.0)]
    #[schemars(range(min = 0.0, max = 15000.0))]
    pub latency_ms: f64,
    /// Pixel format.
    #[serde(default)]
    pub encoding: Encoding,
    /// Image: its size, and the location and orientation of the mirror in it.
    pub picture: MirrorImageConfig,
    /// Shape of the mirror.
    pub mirror: MirrorConfig,
    /// Pose on the robot of the lens, or of the viewpoint of a radial model; upright if the angles are zero.
    pub mount: MountConfig,
    /// Exposure, vignetting and noise.
    #[serde(default)]
    pub photometry: Photometry,
    /// Sway of the camera on the robot, which is not published; without it, none.
    #[serde(default)]
    pub sway: SwayConfig,
}

impl MirrorCameraConfig {
    /// Returns the description of the sensor.
    ///
    /// # Errors
    /// Invalid parameters of the mirror or of its image.
    pub fn info(&self, name: &str) -> Result<SensorInfo, ParameterError> {
        let kind = SensorKind::MirrorCamera {
            camera: Box::new(self.camera()?),
            mount: self.mount.into(),
            calibrated: Calibration::Measured,
        };
        Ok(super::info::<FrameHeader>(name, self.period_ms, self.latency_ms, kind))
    }

    /// Returns the size of one image, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        frames::frame_bytes(&self.header())
    }

    fn header(&self) -> FrameHeader {
        frames::header(self.encoding, [self.picture.width, self.picture.height], &self.photometry)
    }

    fn camera(&self) -> Result<MirrorCamera, ParameterError> {
        mirror_camera(&self.picture, &self.mirror).map_err(|e| ParameterError::new(e.key(), e.to_string()))
    }
}

/// Renderer of a mirror camera that sways.
pub struct MirrorImageRenderer {
    mount: Mount,
    renderer: MirrorRenderer,
    sway: Sway,
}

/// Returns the camera sensor `name`, with noise and sway from `seed`.
///
/// # Errors
/// Invalid parameters of the mirror or of its image.
pub fn mirror_camera_sensor(
    name: &str,
    config: &MirrorCameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    seed: u64,
) -> Result<FrameSensor<MirrorImageRenderer>, ParameterError> {
    let noise = crate::random::stream(seed, name);
    let renderer = MirrorImageRenderer {
        mount: config.mount.into(),
        renderer: MirrorRenderer::new(config.camera()?, config.photometry, noise),
        sway: Sway::new(config.sway, crate::random::stream(seed, &format!("{name} sway"))),
    };
    Ok(FrameSensor {
        name: name.to_owned(),
        simulation,
        renderer,
        encoding: config.encoding,
        header: config.header(),
        schedule: Schedule::new(config.period_ms, config.latency_ms),
        losses: Losses { share: 0.0, seed },
    })
}

impl ImageRenderer for MirrorImageRenderer {
    fn render(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        sequence: u64,
        encoding: Encoding,
        pixels: &mut [u8],
    ) -> Result<(), RenderError> {
        let view = MirrorView { mount: self.sway.mount(self.mount, sequence), robot };
        match encoding {
            Encoding::Gray8 => self.renderer.render(scene, &view, pixels),
            Encoding::Rgb8 => self.renderer.render_rgb(scene, &view, pixels),
        }
    }
}
