//! Echo of one shot, from the edges of its line.
//!
//! A sonar holds its echo line high from the end of its sound until the sound is back: the length of the pulse gives the range. What
//! is no clean pulse is no measurement, and never "nothing seen": a fault must not look like free space.

use std::fmt;
use std::time::Duration;

use yamabico_core::time::Time;

/// Minimum time between two edges of a sonar: its blanking makes even the nearest echo last longer. Closer ones are interference.
const MIN_PULSE: Duration = Duration::from_micros(50);
/// Maximum time from the end of the trigger pulse to the rise of the echo line: eight periods at 40 kHz, and some.
pub const MAX_START: Duration = Duration::from_millis(5);

/// A change of level on an echo line.
///
/// The kernel stamps it in its interrupt, but reads the new level later: of a short pulse, both edges may look alike. So only times
/// and numbers are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Instant, by the kernel.
    pub at: Time,
    /// Number among the edges of this line; a gap means that the kernel dropped some.
    pub number: u32,
}

/// One shot of a sonar: when it was fired, and until when its line was watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Begin of the trigger pulse.
    pub begun: Time,
    /// End of the trigger pulse. A busy machine may lengthen it.
    pub fired: Time,
    /// End of the watch.
    pub watched: Time,
    /// Level of the echo line at the end of the watch.
    pub is_high: bool,
}

/// Measurement of one shot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Echo {
    /// Instant at which the sound left.
    pub at: Time,
    /// Time until it was back; `None` if the pulse lasted longer than the maximum.
    pub time: Option<Duration>,
}

/// Reason why a shot is no measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The line was high before the shot.
    StuckHigh,
    /// The line never rose.
    Silent,
    /// The kernel dropped edges.
    LostEdges,
    /// The level at the end does not fit the number of edges: one was missed, or is none.
    WrongLevel,
    /// Edges are not in the order of time, or not within the watch.
    WrongTimes,
    /// The line rose too late to answer this shot.
    Late,
    /// The line was not watched for long enough to tell.
    Unfinished,
}

impl Fault {
    /// Cause and remedy, for reports.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Fault::StuckHigh => {
                "its echo line stays high: check power and wiring of the sonar, and that no other sound reaches it"
            }
            Fault::Silent => {
                "its echo line does not rise: check its power, and that `triggers` and `echoes` are the lines it is wired to"
            }
            Fault::LostEdges => {
                "the kernel dropped edges of its echo line: the line is noisy or the machine is too busy"
            }
            Fault::WrongLevel => {
                "an edge of its echo line is missing: the line is noisy, or has no pull-down resistor"
            }
            Fault::WrongTimes => {
                "the kernel's stamps are out of order: its driver for these lines does not stamp edges"
            }
            Fault::Late => "its echo line rises too late: it is noisy, or belongs to another sonar",
            Fault::Unfinished => "the machine was too busy to watch it",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.remedy())
    }
}

impl Shot {
    /// Returns the echo in the edges since the number `last`; a pulse above `max` counts as none. The line was low before.
    ///
    /// # Errors
    /// [`Fault`]. Of several pulses the shortest counts, since a halt for nothing is better than none.
    pub fn echo(&self, edges: &[Edge], last: Option<u32>, max: Duration) -> Result<Echo, Fault> {
        let mut expected = last.map(|last| last.wrapping_add(1));
        for edge in edges {
            if expected.is_some_and(|expected| expected != edge.number) {
                return Err(Fault::LostEdges);
            }
            expected = Some(edge.number.wrapping_add(1));
        }
        let is_ordered = edges.windows(2).all(|pair| pair[0].at <= pair[1].at);
        if !is_ordered || edges.iter().any(|edge| edge.at < self.begun || edge.at > self.watched) {
            return Err(Fault::WrongTimes);
        }
        if self.is_high != (edges.len() % 2 == 1) {
            return Err(Fault::WrongLevel);
        }
        let edges = without_interference(edges);
        let (pulses, rest) = edges.as_chunks::<2>();
        let ended = pulses.iter().map(|[rise, fall]| (rise.at, fall.at.since(rise.at)));
        let first = edges.first().ok_or(Fault::Silent)?;
        if first.at > self.fired + MAX_START {
            return Err(Fault::Late);
        }
        let (at, time) = match (pulses, rest) {
            (_, []) => ended.min_by_key(|(_, time)| *time).ok_or(Fault::Silent)?,
            // A lower bound.
            ([], [rise, ..]) if self.watched.since(rise.at) > max => (rise.at, self.watched.since(rise.at)),
            // It may end at once, or be the echo behind interference.
            _ => return Err(Fault::Unfinished),
        };
        Ok(Echo { at, time: (time <= max).then_some(time) })
    }
}

/// Returns the edges without the pairs that are too close to be those of a sonar.
fn without_interference(edges: &[Edge]) -> Vec<Edge> {
    let mut kept: Vec<Edge> = Vec::with_capacity(edges.len());
    for edge in edges {
        match kept.last() {
            Some(before) if edge.at.since(before.at) < MIN_PULSE => {
                kept.pop();
            }
            _ => kept.push(*edge),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MAX: Duration = Duration::from_micros(17_500);

    fn us(micros: u64) -> Time {
        Time::from_secs_f64(10.0) + Duration::from_micros(micros)
    }

    /// Echo of a shot from 0 to 20 us that was watched for 25 ms, by edges at these times, us, numbered from 1.
    fn echo(times: &[u64], is_high: bool) -> Result<Option<u64>, Fault> {
        let edges: Vec<Edge> =
            times.iter().zip(1..).map(|(at, number)| Edge { at: us(*at), number }).collect();
        let shot = Shot { begun: us(0), fired: us(20), watched: us(25_000), is_high };
        let echo = shot.echo(&edges, Some(0), MAX)?;
        Ok(echo.time.map(|time| time.as_micros() as u64))
    }

    #[test]
    fn the_pulse_gives_the_range_and_a_long_one_none() {
        assert_eq!(echo(&[500, 6_331], false), Ok(Some(5_831)), "1 m");
        assert_eq!(echo(&[500, 615], false), Ok(Some(115)), "2 cm");
        assert_eq!(echo(&[500, 18_001], false), Ok(None), "3 m and a bit");
        assert_eq!(echo(&[500], true), Ok(None), "the line is still high after the time for 3 m");
    }

    #[test]
    fn what_is_no_pulse_is_no_measurement() {
        assert_eq!(echo(&[], false), Err(Fault::Silent));
        assert_eq!(echo(&[], true), Err(Fault::WrongLevel), "the rise was missed");
        assert_eq!(echo(&[500], false), Err(Fault::WrongLevel), "an edge was missed: not free space");
        assert_eq!(echo(&[500, 6_331], true), Err(Fault::WrongLevel));
        assert_eq!(echo(&[6_331, 500], false), Err(Fault::WrongTimes), "reversed");
        assert_eq!(echo(&[500, 26_000], false), Err(Fault::WrongTimes), "from the future");
        assert_eq!(echo(&[6_000, 7_000], false), Err(Fault::Late));
        assert_eq!(echo(&[500, 520], false), Err(Fault::Silent), "interference alone");
        let shot = Shot { begun: us(0), fired: us(20), watched: us(10_000), is_high: true };
        assert_eq!(shot.echo(&[Edge { at: us(500), number: 1 }], None, MAX), Err(Fault::Unfinished));
        let edge = |at, number| Edge { at: us(at), number };
        let shot = Shot { watched: us(25_000), is_high: false, ..shot };
        for edges in [[edge(500, 2), edge(6_331, 3)], [edge(500, 1), edge(6_331, 3)]] {
            assert_eq!(shot.echo(&edges, Some(0), MAX), Err(Fault::LostEdges));
        }
        let wrapped = [edge(500, u32::MAX), edge(6_331, 0)];
        assert!(shot.echo(&wrapped, Some(u32::MAX - 1), MAX).is_ok());
    }

    #[test]
    fn a_spike_close_behind_the_echo_adds_less_than_a_centimeter() {
        assert_eq!(echo(&[1_516, 5_430, 5_476, 5_481], false), Ok(Some(3_965)));
    }

    #[test]
    fn interference_is_removed_and_of_several_pulses_the_shortest_counts() {
        assert_eq!(echo(&[100, 110, 500, 6_331], false), Ok(Some(5_831)), "a spike before the echo");
        assert_eq!(echo(&[500, 2_000, 2_030, 6_331], false), Ok(Some(5_831)), "a gap within the echo");
        assert_eq!(echo(&[500, 6_331, 9_000, 9_010], false), Ok(Some(5_831)), "a spike behind it");
        assert_eq!(echo(&[500, 3_000, 4_000, 6_331], false), Ok(Some(2_331)));
        assert_eq!(echo(&[500, 6_331, 24_000], true), Err(Fault::Unfinished), "a pulse that may be short");
    }

    #[test]
    fn a_trigger_that_the_machine_lengthened_does_no_harm() {
        let shot = Shot { begun: us(0), fired: us(30_000), watched: us(55_000), is_high: false };
        let edges = [Edge { at: us(29_000), number: 1 }, Edge { at: us(34_831), number: 2 }];
        assert_eq!(shot.echo(&edges, Some(0), MAX).unwrap().time, Some(Duration::from_micros(5_831)));
    }

    proptest! {
        /// A missing, an additional or a doubled edge never makes an object seem farther away than it is by 1 cm, or absent.
        #[test]
        fn damage_never_adds_range(
            start in 100_u64..2_000, length in 115_u64..17_000, damage in 0_u8..4, at in 0_u64..25_000,
        ) {
            let mut times = vec![start, start + length];
            match damage {
                0 => drop(times.remove(0)),
                1 => drop(times.remove(1)),
                2 => { times.push(at); times.sort_unstable(); }
                _ => { times.extend([at, at + 5]); times.sort_unstable(); }
            }
            // Sound takes 58 us to and from what is 1 cm farther away. A spike less than 50 us behind the pulse, 5 us long, lengthens it.
            if let Ok(seen) = echo(&times, false) {
                prop_assert!(seen.is_some_and(|seen| seen < length + 58), "{times:?} {seen:?}");
            }
        }
    }
}
