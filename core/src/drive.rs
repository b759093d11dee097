//! The seam that a drive implements.

use crate::message::Command;
use crate::sensor::DeviceError;
use crate::time::Time;

/// A device that moves the robot.
///
/// It brakes by itself, with its own emergency deceleration, when no command has come for its watchdog time.
pub trait Drive: Send {
    /// Takes the newest command, or none where none has come since the last call; called at least once a tick.
    ///
    /// # Errors
    /// The motors do not obey; the run ends.
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError>;
}

/// The wheels of a drive, all alike and equally far from the robot's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// How many.
    pub count: u8,
    /// From the robot's center to where each touches the floor, meters.
    pub from_center_m: f64,
    /// Radius of each, meters.
    pub radius_m: f64,
    /// Largest speed of each, rad/s.
    pub max_radps: f64,
}
