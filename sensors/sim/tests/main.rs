//! Integration tests, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod buildings;
mod device;
mod floors;
mod hallway;
mod lidar;
mod mirror;
mod passages;
mod render;
mod sonar;
mod wire_frame;
mod world;
