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
