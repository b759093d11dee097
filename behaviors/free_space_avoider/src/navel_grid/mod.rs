//! The navel grid: floor or obstacle, cell by cell, in the picture of one forward camera.
//!
//! Abdelfatah et al.: median, iterative threshold, a grid of cells that are obstacles where enough pixels are dark; free
//! cells from the bottom of each column; three weighted sums of what intrudes into the way ahead; four decisions.
//! Differs from \[1\]: the printed rules would drive into obstacles and turn on free floor; inequalities, turn direction and
//! the incomplete set of weights are put right. Which cells the way covers follows from the camera's place above the floor.

pub mod avoider;
pub mod cells;
pub mod decision;
pub mod ground;
pub mod look;
pub mod open_floor;
pub mod sight;
pub mod steering;
pub mod weights;

pub use avoider::NavelGridAvoider;
pub use cells::Cells;
pub use decision::{Decision, Passage, Side, decide};
pub use ground::GroundGrid;
pub use look::{Look, Polarity};
pub use open_floor::OpenFloor;
pub use sight::{Sight, Trouble};
pub use steering::{Motion, Outlook, Steering};
pub use weights::{Sets, Weights};
