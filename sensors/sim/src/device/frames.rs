//! Camera sensor: publishes the images of any renderer.

use std::sync::{Arc, Mutex};

use rand::RngExt;
use yamabico_core::behavior::Outputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::Scene;
use crate::render::{Photometry, RenderError};
use crate::simulation::Simulation;

/// Returns the header of an image of this size (px), without stamp and sequence number.
pub fn header(encoding: Encoding, size: [u32; 2], photometry: &Photometry) -> FrameHeader {
    FrameHeader { exposure: f64::from(photometry.exposure), ..FrameHeader::new(encoding, size) }
}

/// Returns the size of an image with this header, bytes.
pub fn frame_bytes(header: &FrameHeader) -> usize {
    header.stride as usize * header.height as usize
}

/// Renderer of a camera's images.
pub trait ImageRenderer: Send {
    /// Renders frame number `sequence` for this robot pose.
    fn render(
        &mut self,
        scene: &Scene,
        robot: Pose2,
        sequence: u64,
        encoding: Encoding,
        pixels: &mut [u8],
    ) -> Result<(), RenderError>;
}

/// Camera sensor that delivers every frame after its latency.
pub struct FrameSensor<P> {
    pub(super) name: String,
    pub(super) simulation: Arc<Mutex<Simulation>>,
    pub(super) renderer: P,
    pub(super) encoding: Encoding,
    /// Header without stamp and sequence number.
    pub(super) header: FrameHeader,
    pub(super) schedule: Schedule,
    pub(super) losses: Losses,
}

/// Frames that are lost between the camera and the robot.
#[derive(Clone, Copy, Debug)]
pub struct Losses {
    /// Fraction of the frames, 0 to 1.
    pub share: f64,
    /// Seed of the run.
    pub seed: u64,
}

impl Losses {
    /// Returns true if frame number `sequence` of this camera is lost.
    fn include(&self, name: &str, sequence: u64) -> bool {
        let draw =
            |share| crate::random::stream(self.seed, &format!("{name} loss {sequence}")).random_bool(share);
        self.share > 0.0 && draw(self.share.min(1.0))
    }
}

impl<P: ImageRenderer> Sensor for FrameSensor<P> {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        // Frames that a newer one has already replaced are not rendered.
        let Some((sequence, stamp)) = self.schedule.newest(simulation.origin(), now) else {
            return Ok(Due::At(self.schedule.next(simulation.origin())));
        };
        if self.losses.include(&self.name, sequence) {
            return Ok(Due::At(self.schedule.next(simulation.origin())));
        }
        let failed = |e: &dyn std::fmt::Display| DeviceError::failed(&self.name, e);
        let seconds = simulation.seconds(stamp);
        let robot = simulation.at(stamp).pose;
        simulation.scene.set_time(seconds).map_err(|e| failed(&e))?;
        let header = FrameHeader { stamp_ns: stamp.0, sequence, ..self.header };
        let (renderer, scene, encoding) = (&mut self.renderer, &simulation.scene, self.encoding);
        let mut drawn: Result<(), RenderError> = Ok(());
        outputs.publish_in_place(&self.name, &header, frame_bytes(&header), |pixels: &mut [u8]| {
            drawn = renderer.render(scene, robot, sequence, encoding, pixels);
        })?;
        drawn.map_err(|e| failed(&e))?;
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
