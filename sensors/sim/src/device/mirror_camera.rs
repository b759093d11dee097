//! The simulated mirror camera as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{BuildError, Outputs};
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{MirrorCamera, MirrorConfig, MirrorImageConfig, MountConfig};
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{Calibration, DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use super::camera::{PixelFormat, latency_ms, period_ms};
use super::sway::{Sway, SwayConfig};
use super::{Beat, locked};
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
    /// What behaviours are told.
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
        let pixels = self.picture.width as usize * self.picture.height as usize;
        pixels * self.encoding.encoding().bytes_per_pixel() as usize
    }

    fn camera(&self) -> Result<MirrorCamera, BuildError> {
        mirror_camera(&self.picture, &self.mirror).map_err(|e| BuildError::new(e.key(), e.to_string()))
    }
}

/// Takes pictures of the simulation through a mirror and hands them over after their latency.
pub struct AllAround {
    name: String,
    config: MirrorCameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    renderer: MirrorRenderer,
    sway: Sway,
    beat: Beat,
}

impl AllAround {
    /// The camera called `name`; `seed` gives its noise.
    ///
    /// # Errors
    /// A mirror, or an image of it, that cannot be.
    pub fn new(
        name: &str,
        config: MirrorCameraConfig,
        simulation: Arc<Mutex<Simulation>>,
        seed: u64,
    ) -> Result<Self, BuildError> {
        let noise = crate::random::stream(seed, name);
        let renderer = MirrorRenderer::new(config.camera()?, config.photometry, noise);
        let sway = Sway::new(config.sway, crate::random::stream(seed, &format!("{name} sway")));
        let beat = Beat::new(config.period_ms, config.latency_ms);
        Ok(Self { name: name.to_owned(), config, simulation, renderer, sway, beat })
    }
}

impl Sensor for AllAround {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        // A picture that nobody could have seen before the next one is not drawn.
        let Some((sequence, stamp)) = self.beat.newest(simulation.origin(), now) else {
            return Ok(Due::At(self.beat.next(simulation.origin())));
        };
        let failed = |e: &dyn std::fmt::Display| DeviceError::failed(&self.name, e);
        let seconds = simulation.seconds(stamp);
        let moment = simulation.at(stamp);
        simulation.scene.set_time(seconds).map_err(|e| failed(&e))?;
        let mount = self.sway.mount(self.config.mount.into(), sequence);
        let view = MirrorView { mount, robot: moment.pose };
        let encoding = self.config.encoding.encoding();
        let header = FrameHeader {
            stamp_ns: stamp.0,
            sequence,
            width: self.config.picture.width,
            height: self.config.picture.height,
            stride: self.config.picture.width * encoding.bytes_per_pixel(),
            encoding: encoding as u32,
            exposure: f64::from(self.config.photometry.exposure),
        };
        let (renderer, scene) = (&mut self.renderer, &simulation.scene);
        let mut drawn: Result<(), RenderError> = Ok(());
        outputs.publish_in_place(&self.name, &header, self.config.bytes(), |pixels: &mut [u8]| {
            drawn = match encoding {
                Encoding::Gray8 => renderer.render(scene, &view, pixels),
                Encoding::Rgb8 => renderer.render_rgb(scene, &view, pixels),
            };
        })?;
        drawn.map_err(|e| failed(&e))?;
        Ok(Due::At(self.beat.next(simulation.origin())))
    }
}
