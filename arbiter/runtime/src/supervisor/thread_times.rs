//! Times of the threads of a process, as the kernel accounts for them.

use std::path::Path;
use std::time::Duration;

/// Times of one thread of a process since it was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ThreadTimes {
    /// Id of the thread.
    pub id: u32,
    /// Time that it has spent on a processor. While it runs, this lags behind by up to a tick of the kernel (1 to 10 ms).
    pub computed: Duration,
    /// Set if it runs on a processor, or waits for one; not set if it sleeps, is blocked or stopped.
    pub is_runnable: bool,
}

impl ThreadTimes {
    /// Reads the threads of a process from `/proc/PID/task`. `None` where the kernel does not account for them, or the process
    /// does not exist.
    pub fn of_process(pid: u32) -> Option<Vec<ThreadTimes>> {
        let threads = std::fs::read_dir(format!("/proc/{pid}/task")).ok()?;
        // A thread may end in between.
        let threads: Vec<ThreadTimes> =
            threads.flatten().filter_map(|thread| ThreadTimes::read(&thread.path())).collect();
        (!threads.is_empty()).then_some(threads)
    }

    fn read(folder: &Path) -> Option<ThreadTimes> {
        let id = folder.file_name()?.to_str()?.parse().ok()?;
        let text = |file: &str| std::fs::read_to_string(folder.join(file)).ok();
        let (computed, is_runnable) = (parse_schedstat(&text("schedstat")?)?, parse_stat(&text("stat")?)?);
        Some(ThreadTimes { id, computed, is_runnable })
    }
}

/// Time on a processor, from `schedstat`: ns on a processor, ns waited for one, number of turns. `None` without turns, since each
/// thread has had one: the kernel then accounts for nothing.
fn parse_schedstat(text: &str) -> Option<Duration> {
    let mut numbers = text.split_whitespace().map(str::parse::<u64>);
    let (computed, _, turns) = (numbers.next()?.ok()?, numbers.next()?.ok()?, numbers.next()?.ok()?);
    (turns > 0).then_some(Duration::from_nanos(computed))
}

/// Returns true if the state in `stat`, the first field after the name in parentheses, is "running or runnable".
fn parse_stat(text: &str) -> Option<bool> {
    // The name may contain parentheses.
    let state = text.get(text.rfind(')')? + 1..)?.trim_start().chars().next()?;
    Some(state == 'R')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernels_lines_are_read_and_others_refused() {
        assert_eq!(parse_schedstat("998850 1280583 3\n"), Some(Duration::from_nanos(998_850)));
        for text in ["0 0 0", "", "1 2", "1 2 x", "-1 2 3"] {
            assert_eq!(parse_schedstat(text), None, "{text:?}");
        }
        assert_eq!(parse_stat("12 (sim) R 1 1"), Some(true));
        assert_eq!(parse_stat("12 (a) R (b) S 1 1"), Some(false));
        for text in ["", "12 sim R", "12 (sim)"] {
            assert_eq!(parse_stat(text), None, "{text:?}");
        }
    }

    #[test]
    fn a_thread_that_computes_is_told_from_one_that_sleeps() {
        let Some(before) = ThreadTimes::of_process(std::process::id()) else {
            println!("skipped: this kernel does not account for threads in /proc");
            return;
        };
        let own = rustix::thread::gettid().as_raw_nonzero().get().unsigned_abs();
        let begun = std::time::Instant::now();
        while begun.elapsed() < Duration::from_millis(100) {}
        let after = ThreadTimes::of_process(std::process::id()).unwrap();
        let of = |threads: &[ThreadTimes]| *threads.iter().find(|thread| thread.id == own).unwrap();
        assert!(of(&after).is_runnable);
        assert!(of(&after).computed > of(&before).computed, "{before:?} {after:?}");
        let mut sleeper = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let begun = std::time::Instant::now();
        let is_asleep = |threads: &[ThreadTimes]| threads.len() == 1 && !threads[0].is_runnable;
        // On a busy machine it takes some time to fall asleep.
        while !is_asleep(&ThreadTimes::of_process(sleeper.id()).unwrap()) {
            assert!(begun.elapsed() < Duration::from_secs(50), "it never sleeps");
            std::thread::sleep(Duration::from_millis(10));
        }
        sleeper.kill().and_then(|()| sleeper.wait()).unwrap();
        assert_eq!(ThreadTimes::of_process(sleeper.id()), None);
    }
}
