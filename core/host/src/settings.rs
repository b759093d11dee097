//! Settings that the framework applies to a plugin, read from its table in a task or robot file.
//!
//! A behavior's settings are stated once, in [`BehaviorSettings`]. The launch configuration of its process
//! ([`BehaviorLaunch`](crate::process::BehaviorLaunch)) and the arbiter's policy are each derived from it in one place.

use std::time::Duration;

use crate::Scheduling;
use crate::config::{ArbiterKeys, BehaviorKeys, DeviceKeys, Isolation};

/// Settings of one behavior, with every default resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct BehaviorSettings {
    /// Rank in the arbitration of an axis; the highest wins.
    pub priority: i32,
    /// If set, the robot stops while the behavior is silent for longer than its deadline.
    pub critical: bool,
    /// If set, the behavior takes part from the start of the run.
    pub enabled: bool,
    /// Longest time between two calls of `propose`; none for calls on new input only.
    ///
    /// By default a third of the deadline for a critical behavior, and the arbiter's period for one without inputs.
    pub period: Option<Duration>,
    /// Computing time that one call may take; longer calls are counted as overruns.
    pub budget: Option<Duration>,
    /// Maximum age of the instant that a proposal describes.
    pub max_age: Duration,
    /// Maximum age of the oldest sensor data in a proposal.
    pub max_evidence_age: Duration,
    /// Age of the oldest sensor data above which a command from this behavior counts as late.
    pub latency_budget: Option<Duration>,
    /// Minimum duration of a halt or limit.
    pub hold: Duration,
    /// Time that the behavior keeps an axis before a lower priority takes it over.
    pub dwell: Duration,
    /// If set, the behavior is not called while it is inhibited.
    pub sleeps_while_inhibited: bool,
    /// Settings of its process or thread.
    pub host: HostSettings,
}

/// Settings of any plugin, behavior or device, in a live run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HostSettings {
    /// Placement in an own process or on a thread; an external program always has its own process.
    pub isolation: Isolation,
    /// Longest tolerated silence.
    pub deadline: Deadline,
    /// Request to the operating system's scheduler.
    pub scheduling: Scheduling,
    /// External program and its arguments; empty for a plugin that is built into this program.
    pub exec: Vec<String>,
}

/// Longest tolerated silence of a plugin, and every time that is derived from it.
///
/// | Time                      | Value                                   | Meaning                                          |
/// |---------------------------|-----------------------------------------|--------------------------------------------------|
/// | [`proposal_timeout`][pt]  | `deadline_ms`, by default three periods | robot stops if critical and no proposal          |
/// | [`hang_timeout`][ht]      | the same, by default at least 250 ms    | process that is idle without heartbeats has ended |
/// | [`heartbeat_period`][hp]  | 1/4 of the hang timeout                 | longest time between two heartbeats              |
/// | [`overdue_timeout`][ot]   | 3/8 of the hang timeout                 | process without heartbeats is watched closely    |
/// | [`kill_timeout`][kt]      | 7/8 of the hang timeout                 | process without heartbeats is killed             |
/// | [`computing_timeout`][ct] | 5/4 of the hang timeout                 | ... also if it computes                          |
/// | [`max_silence`][ms]       | forty hang timeouts                     | ... also if it waits for a processor             |
/// | [`default_period`][dp]    | 1/3 of the proposal timeout             | call period of a critical behavior               |
///
/// [pt]: Deadline::proposal_timeout
/// [ht]: Deadline::hang_timeout
/// [hp]: Deadline::heartbeat_period
/// [ot]: Deadline::overdue_timeout
/// [kt]: Deadline::kill_timeout
/// [ct]: Deadline::computing_timeout
/// [ms]: Deadline::max_silence
/// [dp]: Deadline::default_period
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline {
    proposal_timeout: Duration,
    hang_timeout: Duration,
    /// Factor on the times after which a process has hung.
    patience: u32,
}

/// Periods in the default deadline.
const DEFAULT_PERIODS: f64 = 3.0;
/// Minimum default hang timeout: a healthy process may be denied the processor for this long.
const MIN_HANG_TIMEOUT: Duration = Duration::from_millis(250);
/// Heartbeats in one hang timeout.
const HEARTBEATS: u32 = 4;
/// The last part of the hang timeout, one in this many, is left for noticing the silence and ending the process.
const KILL_PARTS: u32 = 8;
/// Hang timeouts after which a process that always waited for a processor is killed nevertheless.
const MAX_SILENCE: u32 = 40;
/// Patience with processes whose calls are measured.
const PATIENCE: u32 = 40;

impl Deadline {
    /// Makes the deadline of a table that states `deadline_ms`.
    pub const fn new(deadline: Duration) -> Deadline {
        Deadline { proposal_timeout: deadline, hang_timeout: deadline, patience: 1 }
    }

    /// Makes the default deadline of a behavior that is called every `period_ms`.
    pub fn of_period_ms(period_ms: f64) -> Deadline {
        let proposal_timeout = milliseconds(DEFAULT_PERIODS * period_ms);
        Deadline { hang_timeout: proposal_timeout.max(MIN_HANG_TIMEOUT), ..Deadline::new(proposal_timeout) }
    }

    /// The same deadline, but a process counts as hung only after forty times as long: for measuring how long calls take.
    #[must_use]
    pub fn patient(self) -> Deadline {
        Deadline { patience: PATIENCE, ..self }
    }

    /// Longest time without a proposal; a critical behavior that exceeds it stops the robot.
    pub fn proposal_timeout(self) -> Duration {
        self.proposal_timeout
    }

    /// Time after its last heartbeat by which a hung process that does not compute has ended.
    pub fn hang_timeout(self) -> Duration {
        self.hang_timeout * self.patience
    }

    /// Longest time between two heartbeats of a healthy plugin.
    pub fn heartbeat_period(self) -> Duration {
        self.hang_timeout / HEARTBEATS
    }

    /// Time after its last heartbeat from which on a process is watched closely: one and a half heartbeat periods.
    pub fn overdue_timeout(self) -> Duration {
        self.heartbeat_period() * 3 / 2
    }

    /// Time after its last heartbeat at which a hung process that does not compute is killed.
    pub fn kill_timeout(self) -> Duration {
        self.hang_timeout() - self.hang_timeout() / KILL_PARTS
    }

    /// Time after its last heartbeat at which a process that computes is killed.
    pub fn computing_timeout(self) -> Duration {
        self.hang_timeout() * 5 / 4
    }

    /// Time after its last heartbeat at which a process is killed even if it waited for a processor all the time.
    pub fn max_silence(self) -> Duration {
        self.hang_timeout() * MAX_SILENCE
    }

    /// Call period of a critical behavior that has none of its own.
    pub fn default_period(self) -> Duration {
        self.proposal_timeout / 3
    }
}

impl Default for Deadline {
    /// Deadline of a device without `deadline_ms`.
    fn default() -> Deadline {
        Deadline::new(milliseconds(DeviceKeys::default().deadline_ms))
    }
}

impl Default for BehaviorSettings {
    /// Settings of a table without any of these keys, but with the deadline of a device and no period.
    fn default() -> BehaviorSettings {
        let (keys, arbiter) = (BehaviorKeys::default(), ArbiterKeys::default());
        BehaviorSettings {
            priority: 0,
            critical: keys.critical,
            enabled: keys.enabled,
            period: None,
            budget: None,
            max_age: milliseconds(arbiter.max_age_ms),
            max_evidence_age: milliseconds(arbiter.max_evidence_age_ms),
            latency_budget: None,
            hold: milliseconds(keys.hold_ms),
            dwell: milliseconds(keys.dwell_ms),
            sleeps_while_inhibited: keys.sleeps_while_inhibited,
            host: HostSettings::default(),
        }
    }
}

/// Converts milliseconds of a file to a duration; zero if they are negative or not finite.
pub(crate) fn milliseconds(milliseconds: f64) -> Duration {
    Duration::try_from_secs_f64(milliseconds * 1e-3).unwrap_or(Duration::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_follows_from_the_deadline() {
        let stated = Deadline::new(Duration::from_millis(400));
        let times = [
            stated.proposal_timeout(),
            stated.hang_timeout(),
            stated.heartbeat_period(),
            stated.kill_timeout(),
        ];
        assert_eq!(times.map(|time| time.as_millis()), [400, 400, 100, 350]);
        let default = Deadline::of_period_ms(20.0);
        assert_eq!((default.proposal_timeout().as_millis(), default.hang_timeout().as_millis()), (60, 250));
        assert_eq!(default.default_period().as_millis(), 20);
    }

    #[test]
    fn a_process_is_watched_before_it_can_be_killed_and_ends_within_its_deadline_and_half() {
        for deadline in [Deadline::new(Duration::from_millis(400)), Deadline::of_period_ms(20.0)] {
            let idle = deadline.kill_timeout();
            assert!(deadline.heartbeat_period() < deadline.overdue_timeout());
            assert!(2 * deadline.overdue_timeout() < idle && idle < deadline.hang_timeout());
            assert!(deadline.computing_timeout() * 11 / 10 < deadline.hang_timeout() * 3 / 2);
            assert_eq!(deadline.patient().heartbeat_period(), deadline.heartbeat_period());
            assert_eq!(deadline.patient().kill_timeout(), idle * 40);
        }
    }
}
