//! Localization by odometry alone, for example while a map is recorded along a known path.

use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_vision::map::WireFrame;

use crate::belief::Belief;
use crate::fix::{Fix, NoiseFactors, PoseFinder};

/// Pose finder that uses no images: the pose is propagated by odometry and its covariance grows.
#[derive(Clone, Debug, Default)]
pub struct DeadReckoning {
    walls: WireFrame,
}

impl PoseFinder for DeadReckoning {
    fn walls(&self) -> &WireFrame {
        &self.walls
    }

    fn observe(&mut self, _: &View<'_, FrameHeader>) -> Result<(), Reason> {
        Err(Reason::NoModel)
    }

    fn fix(&mut self, prior: &Belief, _: NoiseFactors) -> Fix {
        Fix::none(prior, Reason::NoModel)
    }

    fn search(&mut self, _: &Belief, _: NoiseFactors) -> Option<Belief> {
        None
    }
}
