//! Drives around obstacles that are not on the map.
//!
//! ```
//! use yamabico_stationary_obstacle_avoider::safe_passage::{Interval, SafePassage};
//!
//! // The camera covers 0.5 m to each side one meter ahead; an obstacle covers 0.1 m around the middle.
//! let mut passage = SafePassage::default();
//! passage.begin(Interval::new(-0.5, 0.5));
//! passage.block(Interval::new(-0.1, 0.1));
//! let aim = passage.choose(0.02, 0.05).expect("a gap");
//! assert!(aim.deviates && (aim.lateral_m - 0.15).abs() < 1e-9);
//! ```
//!
//! Two methods. [`lanes`] (the default) adds up evidence of pictures, their motion and sonars in a grid around the robot, and drives
//! the best lane beside the path ([`LaneAvoider`]). [`PassageAvoider`] follows Ohya, Kosaka & Kak (1998): vertical edges that the
//! map does not explain indicate obstacles; the robot turns to a safe passage, drives through it and returns to its path; any
//! sonar echo halts it. Differs from \[1\]: obstacles are located by their foot on the floor and remembered on the map, walls
//! of the map bound every passage, and faint boxes are detected by their sides on the bare floor.

mod assessment;
pub mod config;
pub mod corridor_frame;
pub mod detector;
pub mod floor_steps;
mod guidance;
pub mod halt_state_machine;
pub mod horizontal_edges;
pub mod lanes;
mod motion_evidence;
pub mod obstacle_memory;
pub mod obstacle_regions;
pub mod overlay;
mod passage_avoider;
pub mod passage_finder;
mod plumb_lines;
pub mod recent_frames;
pub mod regions;
pub mod safe_passage;
mod search;
pub mod sonar_watch;
mod steering;
mod step;
pub mod threshold_learning;
pub mod threshold_table;
pub mod vertical_edges;
pub mod view_history;

pub use config::Config;
pub use lanes::LaneAvoider;
pub use passage_avoider::PassageAvoider;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{
    Axes, Corridor, FrameHeader, ObstaclesHeader, Odometry, PathHeader, Pose, Proposal, RangeScanHeader,
};
use yamabico_core::parameters::FileKind;
use yamabico_vision::map::WIRE_FRAME_FILE;

use crate::config::Method;
use crate::threshold_table::THRESHOLD_FILE;

/// Input: frames of the camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the area ahead");
/// Input: pose estimate in the map frame.
pub const POSE: Slot<Pose> = Slot::optional("pose", "with a map: pose estimate in the map frame");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion since a frame was captured");
/// Input: sonar scans.
pub const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");
/// Input: the planned path, to leave and return to.
pub const PATH: Slot<PathHeader> = Slot::optional("path", "with a map: planned path and progress along it");
/// Input: the corridor around the robot, in place of map, pose and path.
pub const CORRIDOR: Slot<Corridor> =
    Slot::optional("corridor", "without a map: axis and walls of the corridor");
/// Output: confirmed obstacles.
pub const OBSTACLES: Slot<ObstaclesHeader> = Slot::required("obstacles", "obstacles that are not on the map");

/// Behavior that drives around obstacles that are not on the map.
#[derive(Clone, Debug)]
pub enum StationaryObstacleAvoider {
    /// Method `lanes`.
    Lanes(Box<LaneAvoider>),
    /// Method `passages`.
    Passages(Box<PassageAvoider>),
}

impl Plugin for StationaryObstacleAvoider {
    type Config = Config;
    const NAME: &'static str = "stationary-obstacle-avoider";
    const SUMMARY: &'static str = "Drives around obstacles that are not on the map.";
    const INPUTS: &'static [SlotInfo] =
        &[CAMERA.info(), POSE.info(), ODOMETRY.info(), SONAR.info(), PATH.info(), CORRIDOR.info()];
    const OUTPUTS: &'static [SlotInfo] = &[OBSTACLES.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE, THRESHOLD_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        config.check_guidance(setup)?;
        Ok(match config.method {
            Method::Lanes => Self::Lanes(Box::new(LaneAvoider::new(config, setup)?)),
            Method::Passages => Self::Passages(Box::new(PassageAvoider::new(config, setup)?)),
        })
    }

    fn notes(config: &Config, setup: &Setup) -> Vec<String> {
        config.notes(setup)
    }
}

impl Behavior for StationaryObstacleAvoider {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        match self {
            Self::Lanes(avoider) => avoider.propose(inputs, outputs),
            Self::Passages(avoider) => avoider.propose(inputs, outputs),
        }
    }

    fn save_state(&self, state: &mut Vec<u8>) {
        match self {
            Self::Lanes(avoider) => avoider.save_state(state),
            Self::Passages(avoider) => avoider.save_state(state),
        }
    }

    fn restore_state(&mut self, state: &[u8]) {
        match self {
            Self::Lanes(avoider) => avoider.restore_state(state),
            Self::Passages(avoider) => avoider.restore_state(state),
        }
    }
}

impl StationaryObstacleAvoider {
    /// Returns the avoider with method `lanes`; `None` with another method.
    #[must_use]
    pub fn lanes(&self) -> Option<&LaneAvoider> {
        match self {
            Self::Lanes(avoider) => Some(avoider),
            Self::Passages(_) => None,
        }
    }

    /// Returns the avoider with method `passages`; `None` with another method.
    #[must_use]
    pub fn passages(&self) -> Option<&PassageAvoider> {
        match self {
            Self::Passages(avoider) => Some(avoider),
            Self::Lanes(_) => None,
        }
    }
}
