//! Precedence of an overdue process that lacks a processor: a larger share of one until its next heartbeat.
//!
//! It makes the difference between slow and hung plain sooner: a computation that was merely slowed down ends, and an endless loop uses
//! up the time that its deadline allows. Where the kernel groups processes (by session or by cgroup), it acts within the group only.

use rustix::process::{Pid, getpriority_process, setpriority_process};

use super::thread_times::ThreadTimes;

/// Difference of niceness: nine times the share of a process that has none.
const RAISE: i32 = 10;
/// Lowest niceness.
const MIN_NICENESS: i32 = -20;

/// Precedence of one process.
#[derive(Debug, Default)]
pub(super) struct Precedence {
    /// Niceness before it was raised.
    before: Option<i32>,
    /// Set once the system refused it: it takes CAP_SYS_NICE, or a limit of the niceness.
    is_refused: bool,
}

impl Precedence {
    /// Lowers the niceness of the threads of the process `pid` by ten, once. Where that is not permitted, nothing changes.
    pub fn raise(&mut self, pid: u32, threads: &[ThreadTimes]) {
        if self.before.is_some() || self.is_refused {
            return;
        }
        let Some(before) = thread(pid).and_then(|main| getpriority_process(Some(main)).ok()) else { return };
        let raised = (before - RAISE).max(MIN_NICENESS);
        self.is_refused = !set(threads, raised);
        if !self.is_refused {
            self.before = Some(before);
        }
    }

    /// Restores the niceness of the threads of the process `pid`, also of those that it has started meanwhile.
    pub fn restore(&mut self, pid: u32) {
        if let Some(before) = self.before.take() {
            set(&ThreadTimes::of_process(pid).unwrap_or_default(), before);
        }
    }
}

/// Sets the niceness of threads. Returns false if the system refuses it for one that exists.
fn set(threads: &[ThreadTimes], niceness: i32) -> bool {
    let is_set = |id: u32| match thread(id).map(|thread| setpriority_process(Some(thread), niceness)) {
        // It may have ended.
        Some(Ok(()) | Err(rustix::io::Errno::SRCH)) | None => true,
        Some(Err(_)) => false,
    };
    threads.iter().all(|thread| is_set(thread.id))
}

/// Id of a thread; the kernel keeps the niceness of each.
fn thread(id: u32) -> Option<Pid> {
    i32::try_from(id).ok().and_then(Pid::from_raw)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use yamabico_core::time::Time;
    use yamabico_host::Deadline;

    use super::super::liveness::Liveness;
    use super::*;

    #[test]
    fn niceness_is_lowered_once_and_restored() {
        let mut sleeper = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let niceness = || getpriority_process(thread(sleeper.id())).unwrap();
        let (before, threads) = (niceness(), ThreadTimes::of_process(sleeper.id()));
        let mut precedence = Precedence::default();
        if let Some(threads) = threads {
            precedence.raise(sleeper.id(), &threads);
            precedence.raise(sleeper.id(), &threads);
            if precedence.is_refused {
                assert_eq!(niceness(), before);
                println!("skipped: this user may not lower a niceness");
            } else {
                assert_eq!(niceness(), (before - RAISE).max(MIN_NICENESS));
                precedence.restore(sleeper.id());
                assert_eq!(niceness(), before);
            }
        } else {
            println!("skipped: this kernel does not account for threads in /proc");
        }
        sleeper.kill().and_then(|()| sleeper.wait()).unwrap();
    }

    /// Child that computes for ever.
    struct Loop(std::process::Child);

    impl Loop {
        fn start() -> Loop {
            Loop(std::process::Command::new("sh").args(["-c", "while :; do :; done"]).spawn().unwrap())
        }
    }

    impl Drop for Loop {
        fn drop(&mut self) {
            self.0.kill().and_then(|()| self.0.wait()).unwrap();
        }
    }

    /// Silence after which an endless loop with a deadline of 400 ms is found to hang, and whether it was given precedence.
    fn silence_of_a_loop(may_raise: impl Fn() -> Precedence) -> (Duration, bool) {
        let (child, mut precedence) = (Loop::start(), may_raise());
        let mut liveness = Liveness::new(Deadline::new(Duration::from_millis(400)), Time::monotonic_now());
        std::thread::sleep(Duration::from_millis(100));
        liveness.beat(Time::monotonic_now());
        let mut last = Time::monotonic_now();
        loop {
            let now = Time::monotonic_now();
            if now.since(last) > super::super::STANDSTILL {
                liveness.excuse(now.since(last));
            }
            last = now;
            if liveness.is_reading_due(now)
                && let Some(threads) = ThreadTimes::of_process(child.0.id())
            {
                liveness.read(&threads, now);
                if liveness.lacks_processor() {
                    precedence.raise(child.0.id(), &threads);
                }
            }
            if let Some(hang) = liveness.hang(now) {
                return (hang.silent, precedence.before.is_some());
            }
            std::thread::sleep(super::super::PERIOD);
        }
    }

    #[test]
    #[ignore = "a measurement beside four busy loops for each processor"]
    fn an_endless_loop_on_a_busy_machine_is_found_sooner() {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let _load: Vec<Loop> = (0..4 * processors).map(|_| Loop::start()).collect();
        for _ in 0..3 {
            let (without, _) = silence_of_a_loop(|| Precedence { is_refused: true, ..Precedence::default() });
            let (with, is_raised) = silence_of_a_loop(Precedence::default);
            println!("deadline 400 ms: {without:.2?} without precedence, {with:.2?} with ({is_raised})");
            assert!(!is_raised || with < without);
        }
    }
}
