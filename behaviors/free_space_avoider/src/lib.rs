//! Local navigation without a map: finds the free floor in each image of a forward camera or a mirror camera, and steers
//! along it.
//!
//! ```
//! use yamabico_core::camera::{Intrinsics, Mount};
//! use yamabico_core::message::{Kind, Reason};
//! use yamabico_core::testing::{Bench, camera_setup};
//! use yamabico_free_space_avoider::FreeSpaceAvoider;
//!
//! let mount = Mount::tilted(0.6, 28_f64.to_radians());
//! let camera = camera_setup(Intrinsics::from_horizontal_fov(340, 180, 1.57), mount);
//! let mut bench = Bench::<FreeSpaceAvoider>::new("speed_mps = 0.3", camera)?;
//! let proposal = bench.at(0.1).propose(); // no frame yet
//! assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::NoInput)));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```
//!
//! Method [`navel_grid`] (Abdelfatah et al.): a forward camera over a floor that is brighter than obstacles; the robot
//! drives straight on, turns left, turns right, or stops. Method [`polar_cells`] (Sekimori, Usui, Masutani & Miyazaki): a
//! mirror camera over a floor of known color; the robot takes the free direction that it can reach best from its present
//! velocity. Both modules list their differences from the papers; in addition, the robot never drives toward obstacles
//! within its stopping distance, and stops on failures.

pub mod config;
pub mod direction;
pub mod echoes;
pub mod navel_grid;
pub mod polar_cells;
pub mod stopping;

pub use config::Config;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{
    Axes, FrameHeader, FreeSpaceHeader, Goal, Imu, Odometry, Pose, Proposal, RangeScanHeader,
};
use yamabico_core::parameters::FileKind;

use crate::config::Method;
use crate::navel_grid::NavelGridAvoider;
use crate::polar_cells::PolarCellsAvoider;
use yamabico_vision::floor_appearance::FLOOR_APPEARANCE_FILE;
use yamabico_vision::floor_color_file::FLOOR_COLORS_FILE;

/// Input: frames of a forward camera tilted down, or of a mirror camera.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the floor ahead or all around");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::optional(
    "odometry",
    "motion of the robot; required by polar-cells, navel-grid measures turns and learns the floor by it",
);
/// Input: the gyro.
pub const IMU: Slot<Imu> = Slot::optional("imu", "turn rate, in place of that of the wheels");
/// Input: pose of the robot on the map.
pub const POSE: Slot<Pose> =
    Slot::optional("pose", "polar-cells: pose of the robot in the map frame of the goals");
/// Input: goal that replaces the configured one.
pub const GOAL: Slot<Goal> = Slot::optional("goal", "polar-cells: goal that replaces the one in the task");
/// Input: ranges that bound the free floor.
pub const SONAR: Slot<RangeScanHeader> = Slot::optional(
    "sonar",
    "ranges of sonars or of a laser scanner: floor behind an echo is not free; without it, images alone count",
);
/// Output: free floor.
pub const FREE_SPACE: Slot<FreeSpaceHeader> =
    Slot::optional("free-space", "free distance of the floor by direction");

/// Age above which a frame or a range scan is stale, s.
const STALE_S: f64 = 0.5;

/// Behavior that steers along free floor.
#[derive(Clone, Debug)]
pub enum FreeSpaceAvoider {
    /// Method `navel-grid`, for a forward camera.
    NavelGrid(Box<NavelGridAvoider>),
    /// Method `polar-cells`, for a mirror camera.
    PolarCells(Box<PolarCellsAvoider>),
}

impl Plugin for FreeSpaceAvoider {
    type Config = Config;
    const NAME: &'static str = "free-space-avoider";
    const SUMMARY: &'static str =
        "Finds the free floor in each camera image, and steers along it without a map.";
    const INPUTS: &'static [SlotInfo] =
        &[CAMERA.info(), ODOMETRY.info(), POSE.info(), GOAL.info(), SONAR.info(), IMU.info()];
    const OUTPUTS: &'static [SlotInfo] = &[FREE_SPACE.info()];
    const FILES: &'static [FileKind] = &[FLOOR_COLORS_FILE, FLOOR_APPEARANCE_FILE];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
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
    /// Returns the avoider with method `navel-grid`; `None` with another method.
    #[must_use]
    pub fn navel_grid(&self) -> Option<&NavelGridAvoider> {
        match self {
            Self::NavelGrid(avoider) => Some(avoider),
            Self::PolarCells(_) => None,
        }
    }

    /// Returns the avoider with method `polar-cells`; `None` with another method.
    #[must_use]
    pub fn polar_cells(&self) -> Option<&PolarCellsAvoider> {
        match self {
            Self::PolarCells(avoider) => Some(avoider),
            Self::NavelGrid(_) => None,
        }
    }
}
