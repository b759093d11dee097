//! The vocabulary of Yamabico: what robots, sensors, behaviors and the arbiter say to each other.
//!
//! `Frame -> Behavior::propose -> Proposal -> arbiter::decide -> Command -> Drive`
//!
//! No device and no opinion lives here: [`message`] holds the types that travel, [`behavior`], [`sensor`] and [`drive`]
//! the three seams that a plugin implements.

pub mod behavior;
pub mod drive;
pub mod driver;
pub mod message;
pub mod odometry_track;
pub mod plugins;
pub mod sensor;
pub mod testing;
pub mod time;

pub use yamabico_geometry as geometry;
pub use yamabico_geometry::{camera, image};
pub use yamabico_parameters as parameters;
