//! Polar cells: free floor all around by its color, in the picture of a mirror camera.
//!
//! Sekimori, Usui, Masutani & Miyazaki: floor-colored pixels, noise closed, counted in cells of rings and directions; how
//! many cells from the innermost outwards are free tells how far each direction is. Differs from \[1\]: cells are counted
//! without labeling components; colors are learned or taken from the floor before the robot; how the velocity counts is
//! worked out in [`crate::direction`]; what may be wrong with a picture has names.

pub mod avoider;
pub mod destination;
pub mod floor_model;
pub mod free_cells;
pub mod mirror_center;
pub mod pilot;
pub mod sight;

pub use avoider::PolarCellsAvoider;
pub use destination::{Destination, Wish};
pub use floor_model::FloorModel;
pub use free_cells::FreeCells;
pub use pilot::{Pilot, Steer};
pub use sight::{RingSight, Trouble};
