//! Drives where the floor is free, by one picture at a time: ahead of one forward camera, or all around by a mirror.
//!
//! Abdelfatah et al. (navel grid): a forward camera, floor that is brighter than obstacles, four decisions.
//! Sekimori, Usui, Masutani & Miyazaki (polar cells): a mirror camera, floor of one color, a direction for every velocity.
//! Differs from \[1\]: see [`navel_grid`] and [`polar_cells`]; besides, nothing within the stopping distance is driven at, and
//! failures stop.

pub mod config;
pub mod direction;
pub mod navel_grid;
pub mod polar_cells;
pub mod stopping;

pub use config::Config;

use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, FrameHeader, FreeSpaceHeader, Goal, Odometry, Pose, Proposal};
use yamabico_core::parameters::FileKind;

use crate::config::Method;
use crate::navel_grid::NavelGridAvoider;
use crate::polar_cells::PolarCellsAvoider;
use yamabico_vision::floor_color_file::FLOOR_COLORS_FILE;

/// The camera that looks ahead and down, or all around.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "pictures of the floor ahead, or all around");
/// Where the wheels say the robot is.
pub const ODOMETRY: Slot<Odometry> =
    Slot::optional("odometry", "how the robot moves; polar-cells needs it, navel-grid measures turns by it");
/// Where the robot is on the map.
pub const POSE: Slot<Pose> =
    Slot::optional("pose", "polar-cells: where the robot is on the map that goals are on");
/// Where to go.
pub const GOAL: Slot<Goal> = Slot::optional("goal", "polar-cells: a goal that replaces the one in the task");
/// Where the floor is free.
pub const FREE_SPACE: Slot<FreeSpaceHeader> = Slot::optional("free-space", "how far the floor is free");

/// Without a picture for longer (s), the behavior abstains.
const STALE_S: f64 = 0.5;

/// Drives where the floor is free.
#[derive(Clone, Debug)]
pub enum FreeSpaceAvoider {
    /// By a grid in the picture of one forward camera.
    NavelGrid(Box<NavelGridAvoider>),
    /// By cells all around in the picture of a mirror camera.
    PolarCells(Box<PolarCellsAvoider>),
}

impl Plugin for FreeSpaceAvoider {
    type Config = Config;
    const NAME: &'static str = "free-space-avoider";
    const SUMMARY: &'static str = "Drives where the floor is free, without a map, by one picture at a time.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), POSE.info(), GOAL.info()];
    const OUTPUTS: &'static [SlotInfo] = &[FREE_SPACE.info()];
    const FILES: &'static [FileKind] = &[FLOOR_COLORS_FILE];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        config.check()?;
        Ok(match config.method {
            Method::NavelGrid => Self::NavelGrid(Box::new(NavelGridAvoider::new(&config, setup)?)),
            Method::PolarCells => Self::PolarCells(Box::new(PolarCellsAvoider::new(&config, setup)?)),
        })
    }
}

impl Behavior for FreeSpaceAvoider {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        match self {
            Self::NavelGrid(avoider) => avoider.propose(inputs, outputs),
            Self::PolarCells(avoider) => avoider.propose(inputs, outputs),
        }
    }
}

impl FreeSpaceAvoider {
    /// What drives by the navel grid; `None` with another method.
    #[must_use]
    pub fn navel_grid(&self) -> Option<&NavelGridAvoider> {
        match self {
            Self::NavelGrid(avoider) => Some(avoider),
            Self::PolarCells(_) => None,
        }
    }

    /// What drives by polar cells; `None` with another method.
    #[must_use]
    pub fn polar_cells(&self) -> Option<&PolarCellsAvoider> {
        match self {
            Self::PolarCells(avoider) => Some(avoider),
            Self::NavelGrid(_) => None,
        }
    }
}
