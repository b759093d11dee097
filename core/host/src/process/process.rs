//! The life of a plugin's process.

use std::io::Read;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGHUP, SIGTERM};

use super::charge::{Begin, Charge, ChargeError, Part};
use crate::bus::{Bus, BusError, Waiter};
use crate::config::Clock;
use crate::{
    BehaviorSeat, ClockSeat, DeviceSeat, Pulse, SeatError, TurnSeat, behave, behave_in_turn, keep_the_clock,
    operate, topics,
};
use yamabico_core::message::{Command, PluginState};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;

/// Exit code of a plugin that cannot begin.
const CANNOT_BEGIN: u8 = 2;
/// A device that was told to end and hangs is gone after so long.
const LAST_RESORT: Duration = Duration::from_secs(3);
/// Added to the time that a drive needs to stand.
const MARGIN: Duration = Duration::from_millis(200);
/// How often a device that brakes looks.
const BRAKING_NAP: Duration = Duration::from_millis(5);

/// What the death of its parent is for a child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnDeath {
    /// Its own at once.
    Die,
    /// SIGHUP: it brakes first.
    Brake,
}

/// The process that a child must not outlive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guardian {
    /// Its number.
    pub pid: u32,
    /// What its death is for this process.
    pub on_death: OnDeath,
}

impl Guardian {
    /// Ties this process to its guardian, also across `exec`; whether the guardian is still there.
    ///
    /// # Errors
    /// What the system said.
    pub fn follow(self) -> std::io::Result<bool> {
        let signal = match self.on_death {
            OnDeath::Die => Signal::KILL,
            OnDeath::Brake => Signal::HUP,
        };
        set_parent_process_death_signal(Some(signal))?;
        // It may have died before the line above.
        Ok(getppid().and_then(|pid| u32::try_from(Pid::as_raw(Some(pid))).ok()) == Some(self.pid))
    }
}

/// Why a plugin's process cannot begin.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error("standard input cannot be read: {0}")]
    Input(#[from] std::io::Error),
    #[error("standard input is no charge of a plugin: {0}")]
    Toml(#[from] toml::de::Error),
    #[error(transparent)]
    Charge(#[from] ChargeError),
    #[error(transparent)]
    Seat(#[from] SeatError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Device(#[from] DeviceError),
}

impl Refusal {
    /// The key to change, and what is wrong, without saying twice whose it is.
    fn told(&self) -> (String, String) {
        match self {
            Refusal::Seat(SeatError::Device { reason, .. } | SeatError::Build(reason)) => {
                (reason.key.clone(), reason.problem.clone())
            }
            other => (String::new(), other.to_string()),
        }
    }
}

/// Serves as the plugin that standard input charges this process with, one of `plugins`, until SIGTERM. Ends the process.
pub fn serve(plugins: &Plugins) -> ExitCode {
    match try_to_serve(plugins) {
        // Nothing is taken down: whoever is about to read what was said last can do so until the supervisor cleans up.
        Ok(()) => std::process::exit(0),
        Err(refusal) => {
            tracing::error!("{refusal}");
            std::process::exit(i32::from(CANNOT_BEGIN))
        }
    }
}

fn try_to_serve(plugins: &Plugins) -> Result<(), Refusal> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let charge: Charge = toml::from_str(&text)?;
    charge.check()?;
    let (over, orphaned) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    for (signal, flag) in [(SIGTERM, &over), (SIGHUP, &orphaned), (SIGHUP, &over)] {
        signal_hook::flag::register(signal, Arc::clone(flag))?;
    }
    let bus = Bus::join(&charge.robot)?;
    let beat = Duration::try_from_secs_f64(charge.beat_ms * 1e-3).unwrap_or_default();
    let mut pulse = Pulse::open(&bus, &charge.name, charge.restarts, beat)?;
    let served = work(charge, plugins, &bus, &mut pulse, &over, &orphaned);
    if let Err(refusal) = &served {
        let (key, words) = refusal.told();
        pulse.fail(&key, &words, Time::monotonic_now());
    }
    std::mem::forget((bus, pulse));
    served
}

fn work(
    charge: Charge,
    plugins: &Plugins,
    bus: &Bus,
    pulse: &mut Pulse,
    over: &Arc<AtomicBool>,
    orphaned: &AtomicBool,
) -> Result<(), Refusal> {
    let (hosting, begin, clock) = (charge.hosting(), charge.begin, charge.clock);
    let is_over = || over.load(Ordering::Relaxed);
    match charge.part {
        Part::Behavior(part) => {
            let plan = part.plan(&charge.name, plugins, hosting)?;
            let mut waiter = plan.waiter(bus)?;
            let mut seat = BehaviorSeat::open(plan, bus)?;
            if !charge.memory.is_empty() {
                seat.recall(charge.memory.as_bytes());
            }
            let mut turns = in_turns(clock, || TurnSeat::open(bus, &charge.name))?;
            wait_to_begin(begin, bus, pulse, &is_over)?;
            match &mut turns {
                None => behave(&mut seat, &mut waiter, pulse, &is_over),
                Some(turns) => behave_in_turn(&mut seat, turns, pulse, &is_over),
            }
            std::mem::forget((seat, waiter, turns));
        }
        Part::Device(part) => {
            let stops_in = Duration::try_from_secs_f64(part.stops_in_s).unwrap_or_default() + MARGIN;
            let step = Duration::try_from_secs_f64(part.step_ms * 1e-3).unwrap_or_default();
            let mut clock = in_turns(clock, || ClockSeat::open(bus, step))?;
            let plan = part.plan(plugins, hosting)?;
            let mut waiter = bus.waiter(&[topics::COMMAND])?;
            let mut seat = DeviceSeat::open(plan, bus)?;
            wait_to_begin(begin, bus, pulse, &is_over)?;
            end_somehow(Arc::clone(over))?;
            match &mut clock {
                None => operate(&mut seat, &mut waiter, pulse, &is_over),
                Some(clock) => keep_the_clock(&mut seat, clock, pulse, &is_over)?,
            }
            if orphaned.load(Ordering::Relaxed) {
                brake(&mut seat, &mut waiter, stops_in);
                bury(&charge.robot);
            }
            std::mem::forget((seat, waiter, clock));
        }
    }
    Ok(())
}

/// Opens an end of the turns, where the clock is a driver's.
fn in_turns<T>(clock: Clock, open: impl FnOnce() -> Result<T, BusError>) -> Result<Option<T>, BusError> {
    match clock {
        Clock::Machine => Ok(None),
        Clock::Driver => open().map(Some),
    }
}

/// Says that everything is open, and waits for the first command where that is the beginning.
fn wait_to_begin(
    begin: Begin,
    bus: &Bus,
    pulse: &mut Pulse,
    is_over: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    if begin == Begin::AtOnce {
        pulse.beat(PluginState::Starting, Time::monotonic_now());
        return Ok(());
    }
    let commands = bus.subscriber::<Command>(topics::COMMAND)?;
    let mut waiter = bus.waiter(&[topics::COMMAND])?;
    while commands.newest()?.is_none() && !is_over() {
        pulse.beat(PluginState::Starting, Time::monotonic_now());
        waiter.wait(pulse.every())?;
    }
    Ok(())
}

/// Ends this process some time after it was told to, whatever hangs.
fn end_somehow(over: Arc<AtomicBool>) -> std::io::Result<()> {
    let watch = move || {
        while !over.load(Ordering::Relaxed) {
            std::thread::sleep(LAST_RESORT / 10);
        }
        std::thread::sleep(LAST_RESORT);
        std::process::abort();
    };
    std::thread::Builder::new().name("last-resort".into()).spawn(watch).map(drop)
}

/// Brings a robot to rest whose arbiter is gone.
fn brake(seat: &mut DeviceSeat, waiter: &mut Waiter, stops_in: Duration) {
    let begun = Instant::now();
    while begun.elapsed() < stops_in.min(LAST_RESORT) {
        let now = Time::monotonic_now();
        // There is nobody left to tell of what fails now.
        let _ = (seat.brake(now), seat.poll(now), waiter.wait(BRAKING_NAP));
    }
}

/// Leaves nothing of a robot whose supervisor is gone, unless somebody runs it again.
fn bury(robot: &str) {
    if let Err(error) = Bus::bury(robot) {
        tracing::warn!("files of robot `{robot}` stay until it runs again: {error}");
    }
}
