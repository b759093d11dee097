//! Heartbeat watch of a running process.

use std::time::Duration;

use yamabico_core::time::Time;

/// Time within which a process sends its first heartbeat: it may open a device or a map.
const STARTING_TIMEOUT: Duration = Duration::from_secs(10);

/// Heartbeats of one process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Liveness {
    timeout: Duration,
    first: Option<Time>,
    last: Option<Time>,
    since: Time,
}

impl Liveness {
    /// Watches a process that starts `now` and counts as hung after a silence of `timeout`.
    pub fn new(timeout: Duration, now: Time) -> Liveness {
        Liveness { timeout, first: None, last: None, since: now }
    }

    /// Records a heartbeat.
    pub fn beat(&mut self, now: Time) {
        self.first.get_or_insert(now);
        self.last = Some(now);
    }

    /// Time since the first heartbeat; zero if there was none.
    pub fn lived(&self, now: Time) -> Duration {
        self.first.map_or(Duration::ZERO, |first| now.since(first))
    }

    /// Returns true if the process has sent a heartbeat.
    pub fn is_up(&self) -> bool {
        self.last.is_some()
    }

    /// Excludes a span of time that the supervisor missed itself.
    pub fn excuse(&mut self, time: Duration) {
        self.since = self.since + time;
        self.last = self.last.map(|last| last + time);
    }

    /// Duration of the silence of a hung process; `None` if it is not hung.
    pub fn hung_for(&self, now: Time) -> Option<Duration> {
        let (last, timeout) = match self.last {
            Some(last) => (last, self.timeout),
            None => (self.since, STARTING_TIMEOUT),
        };
        let silent = now.since(last);
        (silent > timeout).then_some(silent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Time {
        Time(millis * 1_000_000)
    }

    #[test]
    fn a_process_is_hung_after_a_silence_of_the_timeout() {
        let mut liveness = Liveness::new(Duration::from_millis(280), at(0));
        assert!(liveness.hung_for(at(9_000)).is_none() && !liveness.is_up(), "a start may take its time");
        assert!(liveness.hung_for(at(10_001)).is_some());
        liveness.beat(at(1_000));
        assert!(liveness.hung_for(at(1_280)).is_none() && liveness.is_up());
        assert_eq!(liveness.hung_for(at(1_281)), Some(Duration::from_millis(281)));
        liveness.beat(at(1_400));
        assert_eq!(liveness.lived(at(1_500)), Duration::from_millis(500));
        assert_eq!(Liveness::new(Duration::ZERO, at(0)).lived(at(1_500)), Duration::ZERO);
    }

    #[test]
    fn time_that_the_supervisor_missed_does_not_count() {
        let mut liveness = Liveness::new(Duration::from_millis(280), at(0));
        liveness.beat(at(1_000));
        liveness.excuse(Duration::from_millis(500));
        assert!(liveness.hung_for(at(1_780)).is_none());
        assert!(liveness.hung_for(at(1_781)).is_some());
    }
}
