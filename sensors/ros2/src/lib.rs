//! ROS 2 without an installed ROS: robots whose sensors and drive are topics, velocity commands as behaviors, and observers.
//!
//! | Module | Contents |
//! |---|---|
//! | [`config`] | parameters of devices and behaviors |
//! | [`network_config`] | the network that a part joins: domain, middleware, router |
//! | [`names`] | names of topics and types, in ROS and in DDS |
//! | [`graph`] | who publishes and subscribes what, and why two do not match |
//! | [`ros_clock`] | capture times of messages that other clocks stamped |
//! | [`message`] | messages that are sent |
//! | [`reception`] | the newest message of a topic, with its age |
//! | [`ros_decision`] | decisions of the arbiter as diagnostics and as JSON |
//! | [`twist_mux`] | tasks from configuration files of twist_mux |
//! | `network` | the network: participant, subscriptions, publishers (features `dds`, `zenoh`) |
//! | `driver`, `sensor`, `drive` | robots (the same features) |
//! | `velocity`, `lock`, `observer` | behaviors (the same features) |
//!
//! Received messages are decoded by [`yamabico_recording::ros2`], as in recordings.

pub mod config;
pub mod graph;
pub mod message;
pub mod names;
pub mod network_config;
pub mod reception;
pub mod ros_clock;
pub mod ros_decision;
pub mod twist_mux;

#[cfg(feature = "program")]
mod drive;
#[cfg(feature = "program")]
pub mod driver;
#[cfg(feature = "program")]
pub mod lock;
#[cfg(feature = "program")]
pub mod network;
#[cfg(feature = "program")]
pub mod observer;
#[cfg(feature = "program")]
mod sensor;
#[cfg(feature = "program")]
pub mod velocity;
