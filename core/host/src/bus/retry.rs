//! Retries of opening what another process may be about to create.

use std::time::{Duration, Instant};

/// Retries of an open that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Retry {
    /// None: whatever is missing now stays missing.
    Never,
    /// For half a second: the supervisor may be about to create it.
    Bounded,
}

/// Time after which no further attempt begins.
const RETRY_TIME: Duration = Duration::from_millis(500);
/// Pause between two attempts.
const RETRY_PAUSE: Duration = Duration::from_millis(25);

impl Retry {
    /// Runs `attempt` until it succeeds, fails for good or the time is up.
    pub(super) fn run<T, E>(
        self,
        attempt: impl FnMut() -> Result<T, E>,
        may_succeed_later: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        let begin = Instant::now();
        self.run_by(|| begin.elapsed(), std::thread::sleep, attempt, may_succeed_later)
    }

    /// Like [`Retry::run`], but with a given clock.
    fn run_by<T, E>(
        self,
        elapsed: impl Fn() -> Duration,
        pause: impl Fn(Duration),
        mut attempt: impl FnMut() -> Result<T, E>,
        may_succeed_later: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        let again = || self == Retry::Bounded && elapsed() + RETRY_PAUSE < RETRY_TIME;
        loop {
            match attempt() {
                Err(e) if again() && may_succeed_later(&e) => pause(RETRY_PAUSE),
                result => return result,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn no_attempt_begins_after_half_a_second() {
        let tried = |retry: Retry, attempt_ms| {
            let (clock, attempts) = (Cell::new(Duration::ZERO), Cell::new(0));
            let pass = |time| clock.set(clock.get() + time);
            let attempt = || {
                attempts.set(attempts.get() + 1);
                pass(Duration::from_millis(attempt_ms));
                Err::<(), ()>(())
            };
            assert!(retry.run_by(|| clock.get(), pass, attempt, |()| true).is_err());
            (attempts.get(), clock.get().as_millis())
        };
        assert_eq!(tried(Retry::Bounded, 200), (3, 650));
        assert_eq!(tried(Retry::Bounded, 600), (1, 600));
        assert_eq!(tried(Retry::Bounded, 0), (20, 475));
        assert_eq!(tried(Retry::Never, 0), (1, 0));
        assert_eq!(Retry::Bounded.run(|| Err::<(), u32>(7), |_| false), Err(7));
    }
}
