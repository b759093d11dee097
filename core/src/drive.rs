//! The interface of a drive: the motors of the robot.

use std::time::Duration;

use crate::geometry::Twist;
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

/// The newest command, which expires: the watchdog of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    twist: Twist,
    received: Option<Time>,
    watchdog: Duration,
}

impl Commanded {
    /// Returns no command. Later ones expire after `watchdog`.
    #[must_use]
    pub fn new(watchdog: Duration) -> Commanded {
        Commanded { twist: Twist::ZERO, received: None, watchdog }
    }

    /// Takes a command that was received at `now`. An emergency, or a speed that is not finite, is a stop.
    pub fn set(&mut self, command: &Command, now: Time) {
        let drives = command.emergency == 0 && command.twist.is_finite();
        self.twist = if drives { command.twist } else { Twist::ZERO };
        self.received = Some(now);
    }

    /// Returns true if a command was received within the watchdog's time before `now`.
    #[must_use]
    pub fn is_fresh(&self, now: Time) -> bool {
        self.received.is_some_and(|received| now.since(received) <= self.watchdog)
    }

    /// Returns the twist to drive at `now`: zero once commands have stopped for longer than the watchdog's time.
    #[must_use]
    pub fn twist(&self, now: Time) -> Twist {
        if self.is_fresh(now) { self.twist } else { Twist::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_expire_and_nonsense_stops() {
        let at = Time::from_secs_f64;
        let mut commanded = Commanded::new(Duration::from_millis(200));
        assert!(!commanded.is_fresh(at(1.0)) && commanded.twist(at(1.0)) == Twist::ZERO);
        let forward = Command { twist: Twist::planar(0.3, 0.1), ..Command::default() };
        commanded.set(&forward, at(1.0));
        assert_eq!(commanded.twist(at(1.19)), forward.twist);
        assert_eq!(commanded.twist(at(1.21)), Twist::ZERO);
        for command in
            [Command { emergency: 1, ..forward }, Command { twist: Twist::planar(f64::NAN, 0.0), ..forward }]
        {
            commanded.set(&command, at(2.0));
            assert_eq!(commanded.twist(at(2.0)), Twist::ZERO);
        }
    }
}
