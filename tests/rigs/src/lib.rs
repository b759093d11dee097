//! Simulated robots and worlds that tests, benches and evaluations of behaviors share.
//!
//! - [`board`]: pictures of a printed checkerboard.
//! - [`camera`]: the forward camera of the indoor robots, its frames and its worlds.
//! - [`camera_drive`]: a robot driven by one behavior with camera and odometry, in closed loop.
//! - [`approach`]: corridors that end in a crossing, a T-junction or a wall.
//! - [`office`]: the office of `configs/office.toml` for the navel grid.
//! - [`field`]: a small soccer field and a mirror camera for the polar cells.
//! - [`mirror_robot`]: the robots with a mirror camera of `configs/robots`.
//! - [`passages`]: gaps between obstacles that sonar readings tell from surfaces.
//!
//! Depends on no behavior: a rig is generic over the behavior that it drives.

#![allow(clippy::expect_used, reason = "a rig stops a test at the first surprise")]

pub mod approach;
pub mod board;
pub mod camera;
pub mod camera_drive;
pub mod field;
pub mod mirror_robot;
pub mod office;
pub mod passages;
