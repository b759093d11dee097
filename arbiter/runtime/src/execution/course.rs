//! When a run ends, and how it is brought to rest.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::Serialize;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::config::Run;

use super::lockstep::{Lockstep, Supply};
use super::referee::Referee;
use crate::record::{Tap, Tee};

/// A robot that does not stand by then after it was told to is left to its drive's watchdog.
pub const REST: Duration = Duration::from_secs(5);

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// The goal was reached.
    Arrived,
    /// There was no goal, and every sensor had nothing more.
    SensorsEnded,
    /// The time given was over before the goal was reached; without a goal, the time given was all that was asked.
    TimeOver,
    /// Somebody asked for it.
    Interrupted,
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Since the start.
    pub elapsed: Duration,
    /// From the robot to the goal, meters, where both are known.
    pub to_go_m: Option<f64>,
}

/// Runs `lockstep` until its goal is reached, its time is over, its sensors have ended, something fails or `interrupt` is set;
/// then until the robot stands. `tap` is shown every message, `progress` every step.
///
/// # Errors
/// A device failed.
pub fn run_lockstep(
    lockstep: &mut Lockstep,
    run: &Run,
    interrupt: &AtomicBool,
    tap: &mut dyn Tap,
    progress: &mut dyn FnMut(Progress),
) -> Result<End, DeviceError> {
    let mut referee = Referee::new(run.goal);
    let mut failure = None;
    let mut told: Option<(End, Time)> = None;
    loop {
        let now = lockstep.now();
        let elapsed = now.since(Time::ZERO);
        let stepped = lockstep.step(&mut Tee(vec![&mut referee, tap]));
        progress(Progress { elapsed, to_go_m: referee.to_go_m() });
        let over = match stepped {
            Ok(supply) => ended(run, &referee, elapsed, supply, interrupt),
            Err(error) => {
                failure.get_or_insert(error);
                Some(End::Interrupted)
            }
        };
        told = told.or_else(|| Some((over?, now)));
        let Some((end, since)) = told else { continue };
        lockstep.arbiter().shut_down();
        if (referee.stands() && now > since) || now.since(since) > REST {
            return failure.map_or(Ok(end), Err);
        }
    }
}

/// Whether the run is over, and why.
pub(super) fn ended(
    run: &Run,
    referee: &Referee,
    elapsed: Duration,
    supply: Supply,
    interrupt: &AtomicBool,
) -> Option<End> {
    if interrupt.load(Ordering::Relaxed) {
        Some(End::Interrupted)
    } else if referee.arrived().is_some() {
        Some(End::Arrived)
    } else if supply == Supply::Ended {
        Some(End::SensorsEnded)
    } else if run.duration.is_some_and(|duration| elapsed >= duration) {
        Some(End::TimeOver)
    } else {
        None
    }
}
