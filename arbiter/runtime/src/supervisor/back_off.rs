//! Delay before a plugin restarts.

use std::time::Duration;

/// Lifetime from which on a death is no longer part of a crash loop.
const LONG_LIFE: Duration = Duration::from_millis(500);
/// Number of short lives in a row after which the next start is still immediate.
const IMMEDIATE_RESTARTS: u32 = 5;
/// First delay of a crash loop; each further delay doubles.
const MIN_DELAY: Duration = Duration::from_millis(100);
/// Maximum delay of a crash loop.
const MAX_DELAY: Duration = Duration::from_secs(5);

/// Restart policy: at once after a single crash, ever later in a crash loop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BackOff {
    short_lives: u32,
}

impl BackOff {
    /// Delay before the next start, after a life of this duration.
    pub fn died(&mut self, lived: Duration) -> Duration {
        self.short_lives = if lived < LONG_LIFE { self.short_lives.saturating_add(1) } else { 0 };
        match self.short_lives.checked_sub(IMMEDIATE_RESTARTS + 1) {
            None => Duration::ZERO,
            Some(doublings) => MAX_DELAY.min(MIN_DELAY * 2_u32.saturating_pow(doublings.min(16))),
        }
    }

    /// Returns true in a crash loop.
    pub fn is_crash_loop(&self) -> bool {
        self.short_lives > IMMEDIATE_RESTARTS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_loop_is_slowed_down_until_a_long_life() {
        let mut back_off = BackOff::default();
        let millis: Vec<u128> =
            (0..14).map(|_| back_off.died(Duration::from_millis(30)).as_millis()).collect();
        assert_eq!(millis, [0, 0, 0, 0, 0, 100, 200, 400, 800, 1600, 3200, 5000, 5000, 5000]);
        assert!(back_off.is_crash_loop());
        assert_eq!(back_off.died(LONG_LIFE), Duration::ZERO);
        assert_eq!(back_off.died(Duration::ZERO), Duration::ZERO);
        assert!(!back_off.is_crash_loop());
    }
}
