//! End of a run: its causes, and the lockstep loop that runs until then.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::Serialize;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::config::Run;

use super::goal_monitor::GoalMonitor;
use super::lockstep::{Lockstep, SensorSupply};
use crate::record::{Tap, Tee};

/// Time after which a robot that has not stopped is left to its drive's watchdog.
pub const STOPPING_TIMEOUT: Duration = Duration::from_secs(5);

/// Cause of the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunEnd {
    /// The goal was reached.
    Arrived,
    /// There was no goal, and every sensor ended.
    SensorsEnded,
    /// The duration of the task is over; the goal, if there is one, was not reached.
    TimeOver,
    /// Interrupted, such as by Ctrl-C.
    Interrupted,
}

impl RunEnd {
    /// Name in recordings.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            RunEnd::Arrived => "arrived",
            RunEnd::SensorsEnded => "sensors-ended",
            RunEnd::TimeOver => "time-over",
            RunEnd::Interrupted => "interrupted",
        }
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Time since the start.
    pub elapsed: Duration,
    /// Distance from the robot to the goal, m, if both are known.
    pub to_go_m: Option<f64>,
}

/// Runs `lockstep` until the goal is reached, the time is over, the sensors have ended, a device fails or `interrupt` is set;
/// then until the robot stands. `tap` receives every message, `progress` is called after every step.
///
/// # Errors
/// A device failed.
pub fn run_lockstep(
    lockstep: &mut Lockstep,
    run: &Run,
    interrupt: &AtomicBool,
    tap: &mut dyn Tap,
    progress: &mut dyn FnMut(Progress),
) -> Result<RunEnd, DeviceError> {
    let mut monitor = GoalMonitor::new(run.goal);
    let mut failure = None;
    let mut decided: Option<(RunEnd, Time)> = None;
    loop {
        let now = lockstep.now();
        let elapsed = now.since(Time::ZERO);
        let stepped = lockstep.step(&mut Tee(vec![&mut monitor, tap]));
        progress(Progress { elapsed, to_go_m: monitor.to_go_m() });
        let over = match stepped {
            Ok(supply) => ended(run, &monitor, elapsed, supply, interrupt),
            Err(error) => {
                failure.get_or_insert(error);
                Some(RunEnd::Interrupted)
            }
        };
        decided = decided.or_else(|| Some((over?, now)));
        let Some((end, since)) = decided else { continue };
        lockstep.shut_down();
        if (monitor.stands() && now > since) || now.since(since) > STOPPING_TIMEOUT {
            return failure.map_or(Ok(end), Err);
        }
    }
}

/// Returns the cause of the end if the run is over.
pub(super) fn ended(
    run: &Run,
    monitor: &GoalMonitor,
    elapsed: Duration,
    supply: SensorSupply,
    interrupt: &AtomicBool,
) -> Option<RunEnd> {
    if interrupt.load(Ordering::Relaxed) {
        Some(RunEnd::Interrupted)
    } else if monitor.arrived().is_some() {
        Some(RunEnd::Arrived)
    } else if supply == SensorSupply::Ended {
        Some(RunEnd::SensorsEnded)
    } else if run.duration.is_some_and(|duration| elapsed >= duration) {
        Some(RunEnd::TimeOver)
    } else {
        None
    }
}
