//! Life of a plugin's process: read the launch configuration, open, start, run, end.

use std::io::Read;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGTERM};

use super::launch::{LaunchConfig, LaunchError, Role, Start};
use crate::bus::{Bus, BusError, WaitSet};
use crate::config::Clock;
use crate::settings::milliseconds;
use crate::{
    BehaviorHost, DeviceHost, HostError, PluginReporter, StepFollower, StepLeader, follow_steps, lead_steps,
    run_behavior, run_device, topics,
};
use yamabico_core::message::{Command, PluginState};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;

/// Exit code of a plugin that cannot start working.
const START_FAILED: u8 = 2;
/// Time after the request to end at which a device's process aborts itself.
const ABORT_TIMEOUT: Duration = Duration::from_secs(3);
/// Margin added to the time that a drive needs to stop.
const STOPPING_MARGIN: Duration = Duration::from_millis(200);
/// Period of the control cycle of a drive that stops.
const STOPPING_PERIOD: Duration = Duration::from_millis(5);

/// Failure of a plugin's process.
#[derive(Debug, thiserror::Error)]
enum ServeError {
    #[error("cannot read standard input: {0}")]
    Input(#[from] std::io::Error),
    #[error("standard input is not a launch configuration: {0}")]
    Toml(#[from] toml::de::Error),
    #[error(transparent)]
    Launch(#[from] LaunchError),
    #[error(transparent)]
    Host(#[from] HostError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Device(#[from] DeviceError),
}

impl ServeError {
    /// Key of the plugin's table to change, if any, and text. The text leaves out the plugin's name, which the report
    /// contains.
    fn report(&self) -> (String, String) {
        match self {
            ServeError::Host(HostError::Device { reason, .. } | HostError::Build(reason)) => {
                (reason.key.clone(), reason.problem.clone())
            }
            other => (String::new(), other.to_string()),
        }
    }
}

/// Runs the plugin of the launch configuration on standard input, one of `plugins`, until SIGTERM. Ends the process.
pub fn serve(plugins: &Plugins) -> ExitCode {
    match try_to_serve(plugins) {
        // Ports are not dropped, so that the last messages can be received until the supervisor cleans up.
        Ok(()) => std::process::exit(0),
        Err(error) => {
            tracing::error!("{error}");
            std::process::exit(i32::from(START_FAILED))
        }
    }
}

fn try_to_serve(plugins: &Plugins) -> Result<(), ServeError> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let launch: LaunchConfig = toml::from_str(&text)?;
    launch.check()?;
    plugins.register_messages().map_err(LaunchError::Messages)?;
    let (over, orphaned) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    for (signal, flag) in [(SIGTERM, &over), (SIGHUP, &orphaned), (SIGHUP, &over)] {
        signal_hook::flag::register(signal, Arc::clone(flag))?;
    }
    let bus = Bus::join(&launch.robot)?;
    let heartbeat_period = milliseconds(launch.heartbeat_ms);
    let mut reporter = PluginReporter::open(&bus, &launch.name, launch.restarts, heartbeat_period)?;
    let result = run(launch, plugins, &bus, &mut reporter, &over, &orphaned);
    if let Err(error) = &result {
        let (key, text) = error.report();
        reporter.publish_failure(&key, &text, Time::monotonic_now());
    }
    std::mem::forget((bus, reporter));
    result
}

fn run(
    launch: LaunchConfig,
    plugins: &Plugins,
    bus: &Bus,
    reporter: &mut PluginReporter,
    over: &Arc<AtomicBool>,
    orphaned: &AtomicBool,
) -> Result<(), ServeError> {
    let (start, clock) = (launch.start, launch.clock);
    let is_over = || over.load(Ordering::Relaxed);
    match launch.role {
        Role::Behavior(behavior) => {
            let plan = behavior.plan(&launch.name, plugins)?;
            let mut wait_set = plan.wait_set(bus)?;
            let mut host = BehaviorHost::open(plan, bus)?;
            if !launch.saved_state.is_empty() {
                host.restore_state(launch.saved_state.as_bytes());
            }
            host.set_request(launch.request);
            let mut follower = for_driver_clock(clock, || StepFollower::open(bus, &launch.name))?;
            wait_to_start(start, bus, reporter, &is_over)?;
            match &mut follower {
                None => run_behavior(&mut host, &mut wait_set, reporter, &is_over),
                Some(follower) => follow_steps(&mut host, follower, reporter, &is_over),
            }
            std::mem::forget((host, wait_set, follower));
        }
        Role::Device(device) => {
            let stopping_time =
                Duration::try_from_secs_f64(device.stopping_time_s).unwrap_or_default() + STOPPING_MARGIN;
            let step = milliseconds(device.step_ms);
            let mut leader = for_driver_clock(clock, || StepLeader::open(bus, step))?;
            let plan = device.plan(plugins)?;
            let mut wait_set = bus.wait_set(&[topics::COMMAND])?;
            let mut host = DeviceHost::open(plan, bus)?;
            wait_to_start(start, bus, reporter, &is_over)?;
            abort_if_hung(Arc::clone(over))?;
            match &mut leader {
                None => run_device(&mut host, &mut wait_set, reporter, &is_over),
                Some(leader) => lead_steps(&mut host, leader, reporter, &is_over)?,
            }
            if orphaned.load(Ordering::Relaxed) {
                stop(&mut host, &mut wait_set, stopping_time);
                remove_stale_files(&launch.robot);
            }
            std::mem::forget((host, wait_set, leader));
        }
    }
    Ok(())
}

/// Opens an end of the step protocol if the clock of the run belongs to a driver.
fn for_driver_clock<T>(
    clock: Clock,
    open: impl FnOnce() -> Result<T, BusError>,
) -> Result<Option<T>, BusError> {
    match clock {
        Clock::Machine => Ok(None),
        Clock::Driver => open().map(Some),
    }
}

/// Reports that everything is open, and waits for the start condition.
fn wait_to_start(
    start: Start,
    bus: &Bus,
    reporter: &mut PluginReporter,
    is_over: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    if start == Start::Immediately {
        reporter.publish_heartbeat(PluginState::Starting, Time::monotonic_now());
        return Ok(());
    }
    let commands = bus.subscriber::<Command>(topics::COMMAND)?;
    let mut wait_set = bus.wait_set(&[topics::COMMAND])?;
    while commands.newest()?.is_none() && !is_over() {
        reporter.publish_heartbeat(PluginState::Starting, Time::monotonic_now());
        wait_set.wait(reporter.heartbeat_period())?;
    }
    Ok(())
}

/// Starts a thread that aborts this process if it does not end within [`ABORT_TIMEOUT`] of the request to end.
fn abort_if_hung(over: Arc<AtomicBool>) -> std::io::Result<()> {
    let watch = move || {
        while !over.load(Ordering::Relaxed) {
            std::thread::sleep(ABORT_TIMEOUT / 10);
        }
        std::thread::sleep(ABORT_TIMEOUT);
        std::process::abort();
    };
    std::thread::Builder::new().name("abort-if-hung".into()).spawn(watch).map(drop)
}

/// Stops a robot whose supervisor has died.
fn stop(host: &mut DeviceHost, wait_set: &mut WaitSet, stopping_time: Duration) {
    let begun = Instant::now();
    while begun.elapsed() < stopping_time.min(ABORT_TIMEOUT) {
        let now = Time::monotonic_now();
        // No process is left to report a failure to.
        let _ = (host.stop(now), host.poll(now), wait_set.wait(STOPPING_PERIOD));
    }
}

/// Removes the files of a robot whose supervisor has died, unless another process runs it again.
fn remove_stale_files(robot: &str) {
    if let Err(error) = Bus::remove_stale_files(robot) {
        tracing::warn!("could not remove the files of robot `{robot}`; its next start will: {error}");
    }
}
