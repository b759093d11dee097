//! Time stamps on the clock of a run.

use std::fmt;
use std::ops::{Add, Sub};
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// Time by which the stamp of a usable message may lie in the future, s: clocks of devices are not read at once.
const FUTURE_TOLERANCE_S: f64 = 0.02;

/// A time stamp: nanoseconds on the clock of the run (`CLOCK_MONOTONIC` in live runs, time since the start in
/// lockstep).
///
/// Time stamps of different runs cannot be compared.
#[repr(C)]
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize,
)]
pub struct Time(pub u64);

impl Time {
    /// Zero of the clock.
    pub const ZERO: Time = Time(0);
    /// The latest time stamp.
    pub const MAX: Time = Time(u64::MAX);

    /// Reads the machine's monotonic clock.
    pub fn monotonic_now() -> Time {
        let now = clock_gettime(ClockId::Monotonic);
        Time(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
    }

    /// Creates the time stamp `seconds` after zero. Negative and non-finite values give [`Time::ZERO`].
    pub fn from_secs_f64(seconds: f64) -> Time {
        Time((seconds * 1e9).round() as u64)
    }

    /// Returns the seconds since zero.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Returns the duration since `earlier`, or zero if `earlier` is in the future.
    pub fn since(self, earlier: Time) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }

    /// Returns the signed time from `other` to `self`, s.
    pub fn seconds_after(self, other: Time) -> f64 {
        (self.0 as i128 - other.0 as i128) as f64 * 1e-9
    }

    /// Returns true if a message with this stamp lies too far in the future to be used at `now`: by more than 20 ms.
    pub fn is_future(self, now: Time) -> bool {
        self.seconds_after(now) > FUTURE_TOLERANCE_S
    }

    /// Returns true if a message with this stamp may follow at `now` the message stamped `last`: it is newer, and not from
    /// the future.
    pub fn is_next(self, last: Option<Time>, now: Time) -> bool {
        last.is_none_or(|last| self > last) && !self.is_future(now)
    }
}

impl Add<Duration> for Time {
    type Output = Time;

    fn add(self, duration: Duration) -> Time {
        Time(self.0.saturating_add(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)))
    }
}

impl Sub<Duration> for Time {
    type Output = Time;

    fn sub(self, duration: Duration) -> Time {
        Time(self.0.saturating_sub(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.as_secs_f64())
    }
}

/// Source of the current time within a step of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeSource {
    /// Time does not advance within a step: lockstep, in which computing time must have no effect.
    #[default]
    Step,
    /// The machine's monotonic clock.
    Machine,
}

impl TimeSource {
    /// Returns the current time in a step that began at `step`.
    pub fn now(self, step: Time) -> Time {
        match self {
            TimeSource::Step => step,
            TimeSource::Machine => Time::monotonic_now(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_saturate_at_zero_and_keep_their_sign() {
        let (a, b) = (Time::from_secs_f64(1.0), Time::from_secs_f64(1.5));
        assert_eq!(b.since(a), Duration::from_millis(500));
        assert_eq!(a.since(b), Duration::ZERO);
        assert_eq!(a.seconds_after(b), -0.5);
        assert_eq!(Time::from_secs_f64(-3.0), Time::ZERO);
        assert_eq!(Time::from_secs_f64(f64::NAN), Time::ZERO);
    }

    #[test]
    fn messages_follow_each_other_and_do_not_come_from_the_future() {
        let [last, now] = [1.0, 2.0].map(Time::from_secs_f64);
        for (seconds, is_next) in
            [(0.9, false), (1.0, false), (1.1, true), (2.0, true), (2.019, true), (2.03, false)]
        {
            assert_eq!(Time::from_secs_f64(seconds).is_next(Some(last), now), is_next, "{seconds} s");
        }
        assert!(Time::ZERO.is_next(None, now) && !Time::MAX.is_next(None, now));
    }
}
