//! Devices on serial lines, played by programs on pseudo terminals that are as nasty as real ones.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod bench;
mod create2;
mod damage;
mod firmware;
mod lidar;
mod turtlebot3;
