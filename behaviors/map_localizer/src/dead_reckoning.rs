//! Without any map: by the wheels alone, such as along a known way while a map is made.

use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_vision::map::WireFrame;

use crate::belief::Belief;
use crate::fix::{Fix, PoseFinder, Trust};

/// Finds nothing in pictures: the odometry carries the start on, and the pose grows more uncertain.
#[derive(Clone, Debug, Default)]
pub struct DeadReckoning {
    walls: WireFrame,
}

impl PoseFinder for DeadReckoning {
    fn walls(&self) -> &WireFrame {
        &self.walls
    }

    fn take(&mut self, _: &View<'_, FrameHeader>) -> Result<(), Reason> {
        Err(Reason::NoModel)
    }

    fn fix(&mut self, prior: &Belief, _: Trust) -> Fix {
        Fix::none(prior, Reason::NoModel)
    }

    fn search(&mut self, _: &Belief, _: Trust) -> Option<Belief> {
        None
    }
}
