//! The simulated mirror camera as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{Calibration, MirrorCamera, MirrorConfig, MirrorImageConfig, Mount, MountConfig};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::FrameHeader;
use yamabico_core::sensor::{SensorInfo, SensorKind};

use super::Beat;
use super::pictures::{self, Painter, Pictures, PixelFormat, latency_ms, period_ms};
use super::sway::{Sway, SwayConfig};
use crate::Scene;
use crate::render::{MirrorRenderer, MirrorView, Photometry, RenderError};
use crate::simulation::Simulation;

/// A camera that looks all around through a mirror.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorCameraConfig {
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
    /// The image: its size, and where and how the mirror is seen in it.
    pub picture: MirrorImageConfig,
    /// The mirror.
    pub mirror: MirrorConfig,
    /// Where it sits on the robot: the lens, or the viewpoint of a radial model. Upright at zero angles.
    pub mount: MountConfig,
    /// Exposure, vignetting and noise.
    #[serde(default)]
    pub photometry: Photometry,
    /// How the camera sways on the robot, which nobody is told; without it, not at all.
    #[serde(default)]
    pub sway: SwayConfig,
}

impl MirrorCameraConfig {
    /// What behaviors are told.
    ///
    /// # Errors
    /// A mirror, or an image of it, that cannot be.
    pub fn info(&self, name: &str) -> Result<SensorInfo, BuildError> {
        let kind = SensorKind::MirrorCamera {
            camera: Box::new(self.camera()?),
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
        self.encoding.header([self.picture.width, self.picture.height], &self.photometry)
    }

    fn camera(&self) -> Result<MirrorCamera, BuildError> {
        mirror_camera(&self.picture, &self.mirror).map_err(|e| BuildError::new(e.key(), e.to_string()))
    }
}

/// The mirror, and where it is.
pub struct AllAround {
    mount: Mount,
    renderer: MirrorRenderer,
    sway: Sway,
}

/// The camera called `name`; `seed` gives its noise and its sway.
///
/// # Errors
/// A mirror, or an image of it, that cannot be.
pub fn all_around(
    name: &str,
    config: &MirrorCameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    seed: u64,
) -> Result<Pictures<AllAround>, BuildError> {
    let noise = crate::random::stream(seed, name);
    let painter = AllAround {
        mount: config.mount.into(),
        renderer: MirrorRenderer::new(config.camera()?, config.photometry, noise),
        sway: Sway::new(config.sway, crate::random::stream(seed, &format!("{name} sway"))),
    };
    Ok(Pictures {
        name: name.to_owned(),
        simulation,
        painter,
        format: config.encoding,
        header: config.header(),
        beat: Beat::new(config.period_ms, config.latency_ms),
    })
}

impl Painter for AllAround {
    fn paint(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        sequence: u64,
        format: PixelFormat,
        pixels: &mut [u8],
    ) -> Result<(), RenderError> {
        let view = MirrorView { mount: self.sway.mount(self.mount, sequence), robot };
        match format {
            PixelFormat::Gray8 => self.renderer.render(scene, &view, pixels),
            PixelFormat::Rgb8 => self.renderer.render_rgb(scene, &view, pixels),
        }
    }
}
