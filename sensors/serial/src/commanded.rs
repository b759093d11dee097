//! The newest command of the arbiter, and the watchdog on it.

use std::time::Duration;

use yamabico_core::geometry::Twist;
use yamabico_core::message::Command;
use yamabico_core::time::Time;

/// The newest command, which expires.
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

/// Slows a differential drive down on the same curve if a wheel would be faster than `max_mps`. Returns the speeds of the left
/// and the right wheel, m/s, of a robot with wheels `track_m` apart.
#[must_use]
pub fn wheel_speeds(twist: &Twist, track_m: f64, max_mps: f64) -> [f64; 2] {
    let turning = 0.5 * track_m * twist.angular;
    let wheels = [twist.linear - turning, twist.linear + turning];
    let fastest = wheels[0].abs().max(wheels[1].abs());
    let share = if fastest > max_mps { max_mps / fastest } else { 1.0 };
    wheels.map(|speed| speed * share)
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

    #[test]
    fn wheels_keep_the_curve_when_they_are_too_fast() {
        let [left, right] = wheel_speeds(&Twist::planar(0.2, 0.5), 0.2, 0.5);
        assert!((left - 0.15).abs() < 1e-12 && (right - 0.25).abs() < 1e-12);
        let [left, right] = wheel_speeds(&Twist::planar(1.0, 2.0), 0.2, 0.6);
        assert!((right - 0.6).abs() < 1e-12 && (left / right - 0.8 / 1.2).abs() < 1e-12);
    }
}
