//! Whatever takes pictures of the simulation, as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::Outputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Beat, locked};
use crate::Scene;
use crate::render::{Photometry, RenderError};
use crate::simulation::Simulation;

/// What a pixel holds.
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
    fn encoding(self) -> Encoding {
        match self {
            Self::Gray8 => Encoding::Gray8,
            Self::Rgb8 => Encoding::Rgb8,
        }
    }

    /// The header of a picture of this size (px), without time and number.
    pub fn header(self, [width, height]: [u32; 2], photometry: &Photometry) -> FrameHeader {
        let encoding = self.encoding();
        FrameHeader {
            width,
            height,
            stride: width * encoding.bytes_per_pixel(),
            encoding: encoding as u32,
            exposure: f64::from(photometry.exposure),
            ..FrameHeader::default()
        }
    }
}

/// Bytes of one picture with this header.
pub fn bytes(header: &FrameHeader) -> usize {
    header.stride as usize * header.height as usize
}

/// A camera that draws.
pub trait Painter: Send {
    /// Draws picture number `sequence` from where the robot is.
    fn paint(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        sequence: u64,
        format: PixelFormat,
        pixels: &mut [u8],
    ) -> Result<(), RenderError>;
}

/// Takes pictures of the simulation and hands them over after their latency.
pub struct Pictures<P> {
    pub(super) name: String,
    pub(super) simulation: Arc<Mutex<Simulation>>,
    pub(super) painter: P,
    pub(super) format: PixelFormat,
    /// But for time and number.
    pub(super) header: FrameHeader,
    pub(super) beat: Beat,
}

impl<P: Painter> Sensor for Pictures<P> {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        // A picture that nobody could have seen before the next one is not drawn.
        let Some((sequence, stamp)) = self.beat.newest(simulation.origin(), now) else {
            return Ok(Due::At(self.beat.next(simulation.origin())));
        };
        let failed = |e: &dyn std::fmt::Display| DeviceError::failed(&self.name, e);
        let seconds = simulation.seconds(stamp);
        let robot = simulation.at(stamp).pose;
        simulation.scene.set_time(seconds).map_err(|e| failed(&e))?;
        let header = FrameHeader { stamp_ns: stamp.0, sequence, ..self.header };
        let (painter, scene, format) = (&mut self.painter, &simulation.scene, self.format);
        let mut drawn: Result<(), RenderError> = Ok(());
        outputs.publish_in_place(&self.name, &header, bytes(&header), |pixels: &mut [u8]| {
            drawn = painter.paint(scene, robot, sequence, format, pixels);
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
