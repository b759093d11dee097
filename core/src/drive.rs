//! The interface of a drive: the motors of the robot.

use crate::message::Command;
use crate::sensor::DeviceError;
use crate::time::Time;

/// A device that moves the robot.
///
/// A drive must brake by itself, with its emergency deceleration, if no command arrives within its watchdog time.
pub trait Drive: Send {
    /// Applies the newest command, or `None` if none has arrived since the last call. Called at least once per arbiter
    /// period.
    ///
    /// # Errors
    /// The motors do not respond: the run ends.
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError>;
}

/// Wheels of a drive: equal, and at equal distances from the robot's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// Number of wheels.
    pub count: u8,
    /// Distance from the robot's center to each wheel's contact point, m.
    pub from_center_m: f64,
    /// Wheel radius, m.
    pub radius_m: f64,
    /// Maximum wheel speed, rad/s.
    pub max_radps: f64,
}
