//! Capture times, on the clock of this machine, of messages that another clock stamped.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use yamabico_core::time::Time;

/// Maximum age of a message on arrival; a stamp that seems older is of another clock.
const MAX_AGE_NS: i64 = 2_000_000_000;
/// Maximum lead of another machine's clock that counts as noise.
const MAX_LEAD_NS: i64 = 20_000_000;
/// Time after which a simulated clock that does not tick is forgotten.
const MAX_SILENCE: Duration = Duration::from_secs(5);

/// Origin of a capture time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampSource {
    /// The stamp, by the calendar clocks of both machines.
    Calendar,
    /// The stamp, by the simulated time on `/clock`.
    Simulated,
    /// The arrival: the message has no stamp.
    Unstamped,
    /// The arrival: the other machine's clock is ahead by this time, ns.
    Ahead(i64),
    /// The arrival: the stamp is of an unknown clock.
    Unknown,
}

/// The clocks of the other side.
#[derive(Clone, Copy, Debug, Default)]
pub struct RosClock {
    /// Newest time on `/clock`, ns, and its arrival.
    simulated: Option<(u64, Time)>,
}

impl RosClock {
    /// Takes the time `ns` on `/clock`, which arrived at `arrival`.
    pub fn tick(&mut self, ns: u64, arrival: Time) {
        self.simulated = Some((ns, arrival));
    }

    /// Returns the capture time of a message with the stamp `stamp_ns` that arrived at `arrival`, when the calendar clock of
    /// this machine was `calendar_ns` after 1970. It is never after the arrival.
    #[must_use]
    pub fn capture(&self, stamp_ns: u64, calendar_ns: u64, arrival: Time) -> (Time, StampSource) {
        if stamp_ns == 0 {
            return (arrival, StampSource::Unstamped);
        }
        let age_ns = difference(calendar_ns, stamp_ns);
        if (0..MAX_AGE_NS).contains(&age_ns) {
            return (before(arrival, age_ns), StampSource::Calendar);
        }
        if (-MAX_LEAD_NS..0).contains(&age_ns) {
            return (arrival, StampSource::Calendar);
        }
        if let Some((now_ns, heard)) = self.simulated.filter(|(_, heard)| arrival.since(*heard) < MAX_SILENCE)
        {
            let since_ns = i64::try_from(arrival.since(heard).as_nanos()).unwrap_or(0);
            let age_ns = difference(now_ns, stamp_ns).saturating_add(since_ns);
            if (-MAX_AGE_NS..MAX_AGE_NS).contains(&age_ns) {
                return (before(arrival, age_ns.max(0)), StampSource::Simulated);
            }
        }
        let is_ahead = (-MAX_AGE_NS..0).contains(&age_ns);
        (arrival, if is_ahead { StampSource::Ahead(-age_ns) } else { StampSource::Unknown })
    }
}

/// Time of the calendar clock of this machine, ns since 1970.
#[must_use]
pub fn calendar_now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

fn difference(a_ns: u64, b_ns: u64) -> i64 {
    i64::try_from(i128::from(a_ns) - i128::from(b_ns)).unwrap_or(i64::MAX)
}

fn before(arrival: Time, age_ns: i64) -> Time {
    arrival - Duration::from_nanos(u64::try_from(age_ns).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALENDAR_NS: u64 = 1_790_000_000_000_000_000;

    /// Capture time, ms, of a message that arrives at 100 s.
    fn capture(clock: &RosClock, stamp_ns: u64) -> (i64, StampSource) {
        let (time, source) = clock.capture(stamp_ns, CALENDAR_NS, Time::from_secs_f64(100.0));
        ((1e3 * time.as_secs_f64()).round() as i64, source)
    }

    #[test]
    fn stamps_of_a_synchronized_clock_give_the_age() {
        let clock = RosClock::default();
        assert_eq!(capture(&clock, CALENDAR_NS - 30_000_000), (99_970, StampSource::Calendar));
        assert_eq!(capture(&clock, CALENDAR_NS + 5_000_000), (100_000, StampSource::Calendar));
    }

    #[test]
    fn stamps_of_other_clocks_count_from_arrival_and_are_told() {
        let clock = RosClock::default();
        assert_eq!(capture(&clock, 0), (100_000, StampSource::Unstamped));
        assert_eq!(capture(&clock, CALENDAR_NS + 300_000_000), (100_000, StampSource::Ahead(300_000_000)));
        assert_eq!(capture(&clock, 12_000_000_000), (100_000, StampSource::Unknown));
        assert_eq!(capture(&clock, u64::MAX), (100_000, StampSource::Unknown));
    }

    #[test]
    fn simulated_time_gives_the_age_while_it_ticks() {
        let mut clock = RosClock::default();
        clock.tick(12_000_000_000, Time::from_secs_f64(99.99));
        assert_eq!(capture(&clock, 11_960_000_000), (99_950, StampSource::Simulated));
        clock.tick(12_000_000_000, Time::from_secs_f64(90.0));
        assert_eq!(capture(&clock, 11_960_000_000).1, StampSource::Unknown);
    }
}
