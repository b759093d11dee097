//! Devices that tests play: what real ones say on their lines and sockets, with their bad manners.
//!
//! - [`plug`]: a serial port on a pseudo terminal that can be pulled out, with damage, delay and silence.
//! - [`create2`], [`turtlebot3`], [`lidar`]: what is behind the port.
//! - [`picture_server`]: a camera that serves motion JPEG over HTTP.

#![allow(
    clippy::unwrap_used,
    clippy::missing_panics_doc,
    reason = "a played device stops a test at the first surprise"
)]

pub mod create2;
pub mod lidar;
pub mod picture_server;
pub mod plug;
pub mod turtlebot3;
