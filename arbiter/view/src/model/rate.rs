//! Rate of the messages of one publisher.

use std::collections::VecDeque;

use yamabico_core::time::Time;

/// Number of newest messages that a rate is computed from.
const WINDOW: usize = 64;
/// Age above which a message no longer counts, s.
const MAX_AGE_S: f64 = 5.0;

/// Stamps of the newest messages of one publisher.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rate {
    stamps: VecDeque<Time>,
}

impl Rate {
    /// Takes in a message; one that is not newer than the last is left out.
    pub fn add(&mut self, stamp: Time) {
        if self.stamps.back().is_some_and(|last| stamp <= *last) {
            return;
        }
        if self.stamps.len() == WINDOW {
            self.stamps.pop_front();
        }
        self.stamps.push_back(stamp);
    }

    /// Messages per second of the last five seconds, or fewer of a fast publisher; zero if there are not two.
    pub fn hz(&self, now: Time) -> f64 {
        let is_recent = |stamp: &&Time| now.seconds_after(**stamp) < MAX_AGE_S;
        let mut recent = self.stamps.iter().filter(is_recent);
        let count = recent.clone().count();
        let (Some(first), Some(last)) = (recent.next(), self.stamps.back()) else { return 0.0 };
        if count < 2 {
            return 0.0;
        }
        let period_s = last.seconds_after(*first) / (count - 1) as f64;
        // Silence that is longer than two periods lowers the rate.
        let silence_s = now.seconds_after(*last);
        let end = if silence_s > 2.0 * period_s { now } else { *last };
        (count - 1) as f64 / end.seconds_after(*first).max(1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_falls_with_silence() {
        let mut rate = Rate::default();
        (0..40).for_each(|i| rate.add(Time(i * 50_000_000)));
        assert!((rate.hz(Time(1_960_000_000)) - 20.0).abs() < 1e-9);
        assert!(rate.hz(Time::from_secs_f64(4.0)) < 12.0);
        assert_eq!(rate.hz(Time::from_secs_f64(60.0)), 0.0);
        rate.add(Time::ZERO);
        assert_eq!(Rate::default().hz(Time::ZERO), 0.0);
    }
}
