//! Robots and lidars on serial lines.
//!
//! | Driver | Devices | Module |
//! |---|---|---|
//! | `create2` | iRobot Create 2 and Roombas | [`create2`] |
//! | `turtlebot3` | TurtleBot3 on its OpenCR board, without ROS | [`turtlebot3`] |
//! | `ld06` | lidars LD06, LD19 and LD08 (LDS-02) | [`lidar`] |
//! | `microcontroller` | an Arduino, Pico or other board with two wheels and the protocol of this repository | [`microcontroller`] |
//!
//! A [`Line`](line::Line) reads a port on a thread of its own, opens it again after it was lost, and gives every byte to a
//! [`Conversation`](line::Conversation), which knows the device but no port. Frames are cut by a [`Framer`](framing::Framer);
//! stamps, odometry and the watchdog on commands are shared.

pub mod commanded;
pub mod create2;
pub mod dead_reckoning;
pub mod framing;
pub mod lidar;
pub mod line;
pub mod microcontroller;
mod parts;
mod port;
pub mod stamps;
pub mod turtlebot3;

pub use port::PortError;

use std::sync::Arc;

use yamabico_core::driver::Driver;

/// Returns all drivers of this crate.
#[must_use]
pub fn drivers() -> Vec<Arc<dyn Driver>> {
    vec![create2::driver(), lidar::driver(), microcontroller::driver(), turtlebot3::driver()]
}
