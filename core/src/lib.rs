//! The vocabulary of Yamabico: what robots, sensors, behaviours and the arbiter say to each other.
//!
//! `Frame -> Behavior::propose -> Proposal -> arbiter::decide -> Command -> Drive`
//!
//! No device and no opinion lives here: [`message`] holds the types that travel, [`behavior`], [`sensor`] and [`drive`]
//! the three seams that a plugin implements.

pub mod azimuth_map;
pub mod behavior;
pub mod bus;
pub mod camera;
pub mod config;
pub mod corridor;
pub mod drive;
pub mod geometry;
pub mod image;
pub mod map;
pub mod message;
pub mod odometry_track;
pub mod plugin;
pub mod polygon;
pub mod seat;
pub mod sensor;
pub mod testing;
pub mod time;
pub mod vision;
