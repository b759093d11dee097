//! Heartbeat watch of a running process: tells one that hangs from one that computes, or that waits for a processor.
//!
//! The silence of a process, the time since its last heartbeat, counts without the time for which its threads waited for a processor
//! (and without the time that the supervisor missed). What is left, its own time, is limited by its [`Deadline`]:
//! - a process that mostly was idle, since it sleeps, is blocked or stopped, hangs after `kill_timeout`, 7/8 of the deadline;
//! - one that mostly computed hangs after `computing_timeout`, 5/4 of it: a slow computation may still end, an endless loop does not;
//! - any process hangs after a silence of `max_silence`, forty deadlines, however it spent them.
//!
//! On a machine with processors to spare a hang therefore ends within one and a half deadlines. On a busy one a process that gets a
//! third of a processor has three times as long, since killing it would only add the work of its restart. Where the supervisor may
//! give precedence (`precedence`), it gets most of a processor, and a hang ends nearly as soon there.
//!
//! Threads are read only once a heartbeat is overdue, by one and a half heartbeat periods: a healthy process costs nothing. The time
//! before counts as its own. Where the kernel does not account for threads, all of the silence does.

use std::fmt;
use std::time::Duration;

use yamabico_core::time::Time;
use yamabico_host::Deadline;

use super::silence::Silence;
use super::thread_times::ThreadTimes;

/// Deadline for the first heartbeat of a process: it may open a device or a map.
const STARTING: Deadline = Deadline::new(Duration::from_secs(10));
/// Readings of a process in one hang timeout.
const READINGS: u32 = 32;

/// Heartbeats of one process.
#[derive(Clone, Debug)]
pub(super) struct Liveness {
    deadline: Deadline,
    first: Option<Time>,
    /// Last heartbeat, or the start.
    last: Time,
    silence: Silence,
}

/// Finding that a process hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hang {
    /// Duration of its silence.
    pub silent: Duration,
    /// State of its threads in that silence.
    pub cause: Cause,
}

/// State that a hung process was in for most of its silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// Its threads slept, were blocked or stopped.
    Idle,
    /// It computed.
    Computing,
    /// It waited for a processor for too long.
    Starved,
}

impl Liveness {
    /// Watches a process with this deadline that starts `now`.
    pub fn new(deadline: Deadline, now: Time) -> Liveness {
        Liveness { deadline, first: None, last: now, silence: Silence::default() }
    }

    /// Records a heartbeat.
    pub fn beat(&mut self, now: Time) {
        self.first.get_or_insert(now);
        self.last = now;
        self.silence = Silence::default();
    }

    /// Time since the first heartbeat; zero if there was none.
    pub fn lived(&self, now: Time) -> Duration {
        self.first.map_or(Duration::ZERO, |first| now.since(first))
    }

    /// Returns true if the process has sent a heartbeat.
    pub fn is_up(&self) -> bool {
        self.first.is_some()
    }

    /// Excludes a span of time that the supervisor missed itself.
    pub fn excuse(&mut self, time: Duration) {
        self.last = self.last + time;
        self.silence.excuse(time);
    }

    /// Time since the last heartbeat for which the process waited for a processor, as far as it was read.
    pub fn waited(&self) -> Duration {
        self.silence.waited()
    }

    /// Returns true if the process is overdue, and has waited for a processor since then, for more than the time between two readings.
    pub fn lacks_processor(&self) -> bool {
        self.silence.waited() > self.deadline().hang_timeout() / READINGS
    }

    /// Returns true if the threads of the process are to be read now.
    pub fn is_reading_due(&self, now: Time) -> bool {
        let deadline = self.deadline();
        let is_old = |at: Time| now.since(at) >= deadline.hang_timeout() / READINGS;
        now.since(self.last) > deadline.overdue_timeout()
            && (self.silence.read_at().is_none_or(is_old) || self.own_time(now) > deadline.kill_timeout())
    }

    /// Records a reading of the threads of the process.
    pub fn read(&mut self, threads: &[ThreadTimes], now: Time) {
        self.silence.read(threads.to_vec(), now);
    }

    /// Returns the finding that the process hangs; `None` if it does not.
    pub fn hang(&self, now: Time) -> Option<Hang> {
        let (deadline, silent) = (self.deadline(), now.since(self.last));
        let (limit, cause) = match self.silence.is_computing() {
            true => (deadline.computing_timeout(), Cause::Computing),
            false => (deadline.kill_timeout(), Cause::Idle),
        };
        let is_starved = silent > deadline.max_silence();
        match self.own_time(now) > limit {
            true => Some(Hang { silent, cause }),
            false => is_starved.then_some(Hang { silent, cause: Cause::Starved }),
        }
    }

    /// Returns true if the silence exceeds the deadline: the process would hang if it did not compute or wait.
    pub fn is_late(&self, now: Time) -> bool {
        now.since(self.last) > self.deadline().kill_timeout()
    }

    fn deadline(&self) -> Deadline {
        if self.is_up() { self.deadline } else { STARTING }
    }

    /// Time since the last heartbeat for which the process did not wait for a processor.
    fn own_time(&self, now: Time) -> Duration {
        now.since(self.last).saturating_sub(self.silence.waited())
    }
}

impl fmt::Display for Hang {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2?} without a heartbeat", self.silent)?;
        match self.cause {
            Cause::Idle => Ok(()),
            Cause::Computing => f.write_str(", computing"),
            Cause::Starved => f.write_str(", starved"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEADLINE: Deadline = Deadline::new(Duration::from_millis(320));

    fn at(millis: u64) -> Time {
        Time(millis * 1_000_000)
    }

    fn ms(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    /// Watches a process with a deadline of 320 ms whose last heartbeat came at 1 s. In each millisecond from then on it has
    /// computed `computed_us`. Returns the time of its silence at which it is found to hang, and the cause.
    fn watch(computed_us: u64, is_runnable: bool, accounts: Accounts) -> (u64, Cause) {
        let mut liveness = Liveness::new(DEADLINE, at(0));
        liveness.beat(at(1_000));
        for millis in (0..20_000).step_by(2) {
            let now = at(1_000 + millis);
            if accounts == Accounts::Kept && liveness.is_reading_due(now) {
                let computed = Duration::from_micros(millis * computed_us);
                liveness.read(&[ThreadTimes { id: 1, computed, is_runnable }], now);
            }
            if let Some(hang) = liveness.hang(now) {
                assert_eq!(hang.silent, ms(millis));
                return (millis, hang.cause);
            }
        }
        panic!("it is never found to hang");
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Accounts {
        Kept,
        Missing,
    }

    #[test]
    fn an_idle_process_hangs_within_its_deadline_and_a_computing_one_within_a_half_more() {
        assert_eq!(watch(0, false, Accounts::Kept), (282, Cause::Idle));
        assert_eq!(watch(1000, true, Accounts::Kept), (402, Cause::Computing));
        assert_eq!(watch(1000, true, Accounts::Missing), (282, Cause::Idle), "as without accounts");
    }

    #[test]
    fn time_waited_for_a_processor_does_not_count() {
        // It gets a third of a processor from 120 ms on, when it is watched: 120 ms and 280 ms of its own are 120 + 840 ms.
        let (silent, cause) = watch(333, true, Accounts::Kept);
        assert!((950..980).contains(&silent) && cause == Cause::Computing, "{silent} {cause:?}");
        assert_eq!(
            watch(0, true, Accounts::Kept),
            (12_802, Cause::Starved),
            "none at all, for forty deadlines"
        );
    }

    /// Time of the silence at which a process that computes for ever is found to hang. It gets the first share of a processor, and
    /// the second once it is given precedence.
    fn watch_loop(shares: [f64; 2]) -> u64 {
        let (mut liveness, mut computed_us, mut has_precedence) =
            (Liveness::new(DEADLINE, at(0)), 0.0, false);
        liveness.beat(at(1_000));
        for millis in (0..20_000).step_by(2) {
            let now = at(1_000 + millis);
            if liveness.is_reading_due(now) {
                let computed = Duration::from_micros(computed_us as u64);
                liveness.read(&[ThreadTimes { id: 1, computed, is_runnable: true }], now);
                has_precedence |= liveness.lacks_processor();
            }
            if liveness.hang(now).is_some() {
                return millis;
            }
            computed_us += 2000.0 * shares[usize::from(has_precedence)];
        }
        panic!("it is never found to hang");
    }

    #[test]
    fn precedence_shows_a_hang_on_a_busy_machine_within_its_deadline_and_half() {
        let without = watch_loop([0.14, 0.14]);
        assert!((2_050..2_200).contains(&without), "{without}");
        let with = watch_loop([0.14, 0.85]);
        assert!(with <= 480, "{with}: one and a half deadlines of 320 ms");
        assert_eq!(watch_loop([1.0, 0.0]), 402, "on a machine with processors to spare it is not asked for");
    }

    #[test]
    fn a_heartbeat_begins_a_new_silence() {
        let mut liveness = Liveness::new(DEADLINE, at(0));
        liveness.beat(at(1_000));
        let thread = |computed| ThreadTimes { id: 1, computed, is_runnable: true };
        liveness.read(&[thread(ms(0))], at(1_200));
        liveness.read(&[thread(ms(0))], at(1_500));
        assert_eq!((liveness.waited(), liveness.hang(at(1_500))), (ms(300), None));
        assert!(liveness.is_late(at(1_500)));
        liveness.beat(at(1_510));
        assert_eq!(liveness.waited(), ms(0));
        assert!(!liveness.is_late(at(1_510)) && !liveness.is_reading_due(at(1_600)));
        assert!(liveness.is_reading_due(at(1_640)));
        assert_eq!(liveness.lived(at(2_000)), ms(1_000));
        assert_eq!(Liveness::new(DEADLINE, at(0)).lived(at(1_500)), ms(0));
    }

    #[test]
    fn a_start_may_take_its_time() {
        let mut liveness = Liveness::new(DEADLINE, at(0));
        assert!(liveness.hang(at(8_700)).is_none() && !liveness.is_up());
        assert_eq!(liveness.hang(at(8_751)), Some(Hang { silent: ms(8_751), cause: Cause::Idle }));
        let thread = |computed| ThreadTimes { id: 1, computed, is_runnable: true };
        liveness.read(&[thread(ms(0))], at(4_000));
        liveness.read(&[thread(ms(5_000))], at(19_000));
        assert_eq!(liveness.hang(at(19_000)), None, "it waited for ten of the 15 s");
        liveness.beat(at(20_000));
        assert!(liveness.is_up() && liveness.hang(at(20_281)).is_some());
    }

    #[test]
    fn time_that_the_supervisor_missed_does_not_count() {
        let mut liveness = Liveness::new(DEADLINE, at(0));
        liveness.beat(at(1_000));
        liveness.excuse(ms(60_000));
        assert!(liveness.hang(at(61_280)).is_none());
        assert_eq!(liveness.hang(at(61_281)), Some(Hang { silent: ms(281), cause: Cause::Idle }));
    }

    #[test]
    fn a_hang_fits_into_a_note() {
        let hang = Hang { silent: Duration::from_micros(312_350), cause: Cause::Computing };
        assert_eq!(
            format!("was killed after {hang}"),
            "was killed after 312.35ms without a heartbeat, computing"
        );
        assert!(format!("was killed after {hang}").len() < 64);
    }
}
