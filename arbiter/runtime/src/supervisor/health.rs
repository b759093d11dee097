//! Whether a process that runs is well.

use std::time::Duration;

use yamabico_core::time::Time;

/// Opening a device or a map may take so long.
const COMING_UP: Duration = Duration::from_secs(10);

/// A silent process is given up before its deadline by this part of it, an eighth: time to notice and to end it.
const PARTS: u32 = 8;

/// The signs of life of one process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Health {
    patience: Duration,
    first: Option<Time>,
    heard: Option<Time>,
    since: Time,
}

impl Health {
    /// Of a process that starts `now`, and is to be dead when it has been silent for `deadline`.
    pub fn new(deadline: Duration, now: Time) -> Health {
        let patience = deadline - deadline / PARTS;
        Health { patience, first: None, heard: None, since: now }
    }

    /// It gave a sign of life.
    pub fn hear(&mut self, now: Time) {
        self.first.get_or_insert(now);
        self.heard = Some(now);
    }

    /// How long ago its first sign of life was; nothing where there was none.
    pub fn lived(&self, now: Time) -> Duration {
        self.first.map_or(Duration::ZERO, |first| now.since(first))
    }

    /// Whether it has ever given one.
    pub fn is_up(&self) -> bool {
        self.heard.is_some()
    }

    /// Does not count so much of the time that has passed.
    pub fn excuse(&mut self, time: Duration) {
        self.since = self.since + time;
        self.heard = self.heard.map(|heard| heard + time);
    }

    /// For how long it has been silent, where that is too long.
    pub fn hangs(&self, now: Time) -> Option<Duration> {
        let (last, patience) = match self.heard {
            Some(heard) => (heard, self.patience),
            None => (self.since, COMING_UP),
        };
        let silent = now.since(last);
        (silent > patience).then_some(silent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Time {
        Time(millis * 1_000_000)
    }

    #[test]
    fn silence_is_a_hang_an_eighth_before_its_deadline() {
        let mut health = Health::new(Duration::from_millis(320), at(0));
        assert!(health.hangs(at(9_000)).is_none() && !health.is_up(), "it may take its time to come up");
        assert!(health.hangs(at(10_001)).is_some());
        health.hear(at(1_000));
        assert!(health.hangs(at(1_280)).is_none() && health.is_up());
        assert_eq!(health.hangs(at(1_281)), Some(Duration::from_millis(281)));
        health.hear(at(1_400));
        assert_eq!(health.lived(at(1_500)), Duration::from_millis(500));
        assert_eq!(Health::new(Duration::ZERO, at(0)).lived(at(1_500)), Duration::ZERO);
    }

    #[test]
    fn time_that_the_supervisor_slept_through_does_not_count() {
        let mut health = Health::new(Duration::from_millis(320), at(0));
        health.hear(at(1_000));
        health.excuse(Duration::from_millis(500));
        assert!(health.hangs(at(1_780)).is_none());
        assert!(health.hangs(at(1_781)).is_some());
    }
}
