//! Method `polar-cells`: polar cells of floor color in the image of a mirror camera.
//!
//! Sekimori, Usui, Masutani & Miyazaki: pixels of floor color, after a morphological closing, are counted in cells of
//! rings and directions; the number of free cells from the innermost outward gives the free distance of each direction.
//! Differs from \[1\]: cells are counted without labeling components; colors are learned or taken from the floor in
//! front of the robot; the use of the velocity is worked out in [`crate::direction`]; unreliable images are detected
//! and reported.

pub mod avoider;
pub mod destination;
pub mod floor_model;
pub mod free_cells;
pub mod mirror_center;
pub mod overlay;
pub mod pilot;
pub mod ring_cells;
pub mod ring_observer;

pub use avoider::PolarCellsAvoider;
pub use destination::{Destination, Objective};
pub use floor_model::FloorModel;
pub use free_cells::FreeCells;
pub use pilot::{Maneuver, Pilot};
pub use ring_observer::{RingFailure, RingObserver};
