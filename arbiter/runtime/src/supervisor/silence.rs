//! Silences of a process, divided into times of computing, of waiting for a processor, and of being idle.

use std::time::Duration;

use yamabico_core::time::Time;

use super::thread_times::ThreadTimes;

/// Account of a process since its last heartbeat, from readings of its threads.
///
/// The threads' states at a reading stand for the interval since the reading before.
#[derive(Clone, Debug, Default)]
pub(super) struct Silence {
    /// Newest reading.
    reading: Option<(Time, Vec<ThreadTimes>)>,
    /// Time between the readings that the supervisor missed itself; part of no other time.
    missed: Duration,
    /// Time for which the process waited, ns. The kernel brings the time of a running thread up to date at its ticks only: the
    /// excess of one interval offsets the lack of another, so that an interval may count as negative.
    waited_ns: i64,
    /// Time between readings in which it did not wait, ns.
    own_ns: i64,
    /// Computing time of all threads.
    computed: Duration,
}

impl Silence {
    /// Time of the newest reading; `None` before the first.
    pub fn read_at(&self) -> Option<Time> {
        self.reading.as_ref().map(|(at, _)| *at)
    }

    /// Excludes a span of time that the supervisor missed itself.
    pub fn excuse(&mut self, time: Duration) {
        self.missed += time;
    }

    /// Adds the interval from the reading before to this one.
    pub fn read(&mut self, threads: Vec<ThreadTimes>, now: Time) {
        let missed = std::mem::take(&mut self.missed);
        if let Some((at, before)) = &self.reading {
            let interval = Interval::between(before, &threads, now.since(*at));
            let mut waited_ns = interval.waited_ns;
            if !missed.is_zero() {
                // It may have waited while the supervisor did, which counts once.
                waited_ns = waited_ns.saturating_sub_unsigned(nanos(missed)).max(0);
            }
            let watched = now.since(*at).saturating_sub(missed);
            self.waited_ns = self.waited_ns.saturating_add(waited_ns);
            self.own_ns = self.own_ns.saturating_add_unsigned(nanos(watched)).saturating_sub(waited_ns);
            self.computed += interval.computed;
        }
        self.reading = Some((now, threads));
    }

    /// Time for which the process waited for a processor.
    pub fn waited(&self) -> Duration {
        Duration::from_nanos(u64::try_from(self.waited_ns).unwrap_or(0))
    }

    /// Returns true if the process computed for at least half of the time for which it did not wait.
    pub fn is_computing(&self) -> bool {
        !self.computed.is_zero() && 2 * i128::from(nanos(self.computed)) >= i128::from(self.own_ns)
    }
}

/// Interval between two readings.
struct Interval {
    computed: Duration,
    waited_ns: i64,
}

impl Interval {
    /// Interval from the reading `before` to the reading `after`, a time `length` later. The process waited as long as
    /// its runnable threads did on average.
    fn between(before: &[ThreadTimes], after: &[ThreadTimes], length: Duration) -> Interval {
        let computed_by = |thread: &ThreadTimes| {
            let earlier = before.iter().find(|earlier| earlier.id == thread.id);
            thread.computed.saturating_sub(earlier.map_or(Duration::ZERO, |earlier| earlier.computed))
        };
        let runnable = || after.iter().filter(|thread| thread.is_runnable);
        let count = i64::try_from(runnable().count()).unwrap_or(i64::MAX).max(1);
        let waits = runnable().map(|thread| signed(length).saturating_sub(signed(computed_by(thread))));
        Interval {
            computed: after.iter().map(computed_by).sum(),
            waited_ns: waits.fold(0_i64, i64::saturating_add) / count,
        }
    }
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

fn signed(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Time {
        Time(millis * 1_000_000)
    }

    fn ms(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    fn thread(id: u32, computed_ms: u64, is_runnable: bool) -> ThreadTimes {
        ThreadTimes { id, computed: ms(computed_ms), is_runnable }
    }

    #[test]
    fn a_process_computes_waits_or_is_idle() {
        let all = |second: ThreadTimes| {
            let mut silence = Silence::default();
            silence.read(vec![thread(1, 40, true)], at(1000));
            silence.read(vec![second], at(1100));
            (silence.waited(), silence.is_computing())
        };
        assert_eq!(all(thread(1, 140, true)), (ms(0), true));
        assert_eq!(all(thread(1, 40, false)), (ms(0), false));
        assert_eq!(all(thread(1, 70, true)), (ms(70), true), "a third of a processor");
        assert_eq!(all(thread(1, 40, true)), (ms(100), false), "no processor at all");
        assert_eq!(all(thread(1, 60, false)), (ms(0), false), "it computed a little, then slept");
        assert_eq!(all(thread(1, 100, false)), (ms(0), true));
        // A thread that did not exist before.
        assert_eq!(all(thread(2, 60, true)), (ms(40), true));
    }

    #[test]
    fn ticks_of_the_kernel_do_not_look_like_waiting() {
        let mut silence = Silence::default();
        // A processor of its own, brought up to date every 10 ms, read every 7 ms.
        for reading in 0..=100 {
            silence.read(vec![thread(1, reading * 7 / 10 * 10, true)], at(reading * 7));
        }
        assert!(silence.waited() <= ms(10) && silence.is_computing(), "{silence:?}");
    }

    #[test]
    fn threads_that_sleep_are_not_asked() {
        let mut silence = Silence::default();
        let threads = |computed_ms| vec![thread(1, computed_ms, true), thread(2, 5, false)];
        silence.read(threads(0), at(0));
        silence.read(threads(100), at(100));
        assert_eq!(silence.waited(), ms(0));
        // Two that share one processor each wait for half of the time.
        let both = |computed_ms| vec![thread(1, computed_ms, true), thread(2, computed_ms, true)];
        let mut silence = Silence::default();
        silence.read(both(0), at(0));
        silence.read(both(50), at(100));
        assert_eq!((silence.waited(), silence.is_computing()), (ms(50), true));
    }

    #[test]
    fn a_wait_that_the_supervisor_missed_counts_once() {
        let waits = |missed_ms: u64, computed_ms: u64| {
            let mut silence = Silence::default();
            silence.read(vec![thread(1, 0, true)], at(0));
            silence.excuse(ms(missed_ms));
            silence.read(vec![thread(1, computed_ms, true)], at(100));
            silence.waited()
        };
        assert_eq!(waits(60, 0), ms(40));
        assert_eq!(waits(60, 80), ms(0));
        assert_eq!(waits(100, 100), ms(0));
        assert_eq!(waits(0, 80), ms(20));
    }
}
