//! Method `navel-grid`: a grid of floor and obstacle cells in the image of one forward camera.
//!
//! Abdelfatah et al.: median filter, iterative threshold, a grid in which cells with enough dark pixels are obstacles,
//! the number of free cells from the bottom of each column, three weighted sums of the obstacles in the path ahead, and
//! four decisions. Differs from \[1\]: inequalities, turn direction and the incomplete set of weights are corrected,
//! since the printed rules drive into obstacles and turn on free floor; the cells that the path covers follow from the
//! camera's mount; and floor may be recognized by its learned look instead of its brightness.

pub mod area_average;
pub mod avoider;
pub mod cell_detector;
pub mod cells;
pub mod dark_cells;
pub mod decision;
pub mod ground;
pub mod isodata;
pub mod look_cells;
pub mod open_floor;
pub mod overlay;
pub mod path_observer;
pub mod steering;
pub mod weights;

pub use avoider::NavelGridAvoider;
pub use cell_detector::{CellDetector, Polarity};
pub use cells::Cells;
pub use decision::{Decision, Passage, Side, decide};
pub use ground::GroundGrid;
pub use look_cells::LookCells;
pub use open_floor::OpenFloor;
pub use path_observer::{GridFailure, PathObserver};
pub use steering::{Motion, Observation, Steering};
pub use weights::{WeightSets, Weights};
