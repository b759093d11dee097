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
}
