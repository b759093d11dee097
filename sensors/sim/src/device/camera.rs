//! The simulated camera as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{BuildError, Outputs};
use yamabico_core::camera::{Distortion, IntrinsicsConfig, MountConfig};
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{Calibration, DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use super::{Beat, locked};
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

/// What a pixel holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PixelFormat {
    /// A grey level.
    #[default]
    Gray8,
    /// Red, green and blue.
    Rgb8,
}

impl PixelFormat {
    pub(super) fn encoding(self) -> Encoding {
        match self {
            Self::Gray8 => Encoding::Gray8,
            Self::Rgb8 => Encoding::Rgb8,
        }
    }
}

impl CameraConfig {
    /// What behaviours are told.
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
        let pixels = self.intrinsics.width as usize * self.intrinsics.height as usize;
        pixels * self.encoding.encoding().bytes_per_pixel() as usize
    }
}

/// Takes pictures of the simulation and hands them over after their latency.
pub struct Camera {
    name: String,
    config: CameraConfig,
    simulation: Arc<Mutex<Simulation>>,
    renderer: Renderer,
    beat: Beat,
}

impl Camera {
    /// The camera called `name`; `seed` gives its noise.
    #[must_use]
    pub fn new(name: &str, config: CameraConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        let renderer = Renderer::new(config.photometry, crate::random::stream(seed, name));
        let beat = Beat::new(config.period_ms, config.latency_ms);
        Self { name: name.to_owned(), config, simulation, renderer, beat }
    }
}

impl Sensor for Camera {
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
        let view = CameraView {
            intrinsics: self.config.intrinsics.intrinsics(),
            mount: self.config.mount.into(),
            robot: moment.pose,
        };
        let encoding = self.config.encoding.encoding();
        let header = FrameHeader {
            stamp_ns: stamp.0,
            sequence,
            width: view.intrinsics.width,
            height: view.intrinsics.height,
            stride: view.intrinsics.width * encoding.bytes_per_pixel(),
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

pub(super) fn period_ms() -> f64 {
    100.0
}
pub(super) fn latency_ms() -> f64 {
    30.0
}
