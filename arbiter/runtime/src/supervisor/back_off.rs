//! How soon a plugin that died is started again.

use std::time::Duration;

/// Who lived this long died of something new.
const LONG_LIFE: Duration = Duration::from_millis(500);
/// Short lives in a row that are followed by the next one at once.
const FREE: u32 = 5;
const SHORTEST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(5);

/// Lets a plugin start again at once, and one that keeps dying ever later: every five seconds in the end.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BackOff {
    short_lives: u32,
}

impl BackOff {
    /// How long to wait with the next start after a life that lasted so long.
    pub fn died(&mut self, lived: Duration) -> Duration {
        self.short_lives = if lived < LONG_LIFE { self.short_lives.saturating_add(1) } else { 0 };
        match self.short_lives.checked_sub(FREE + 1) {
            None => Duration::ZERO,
            Some(doublings) => LONGEST.min(SHORTEST * 2_u32.saturating_pow(doublings.min(16))),
        }
    }

    /// Whether it dies again and again.
    pub fn loops(&self) -> bool {
        self.short_lives > FREE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_loop_is_slowed_down_and_a_long_life_makes_good() {
        let mut back_off = BackOff::default();
        let millis: Vec<u128> =
            (0..14).map(|_| back_off.died(Duration::from_millis(30)).as_millis()).collect();
        assert_eq!(millis, [0, 0, 0, 0, 0, 100, 200, 400, 800, 1600, 3200, 5000, 5000, 5000]);
        assert!(back_off.loops());
        assert_eq!(back_off.died(LONG_LIFE), Duration::ZERO);
        assert_eq!(back_off.died(Duration::ZERO), Duration::ZERO);
        assert!(!back_off.loops());
    }
}
