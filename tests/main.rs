//! The claims that Yamabico makes, one module for each claim.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod buildings;
mod corner;
mod corridor;
mod dependencies;
mod faults;
mod field;
mod field_crossing;
mod hallway;
mod intersection;
mod language;
mod lidar;
mod localization;
mod obstacle;
mod office;
mod overlays;
mod photos;
mod recorded_pictures;
mod room;
mod support;
