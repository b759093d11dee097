//! Loops of plugins in a live run, each on a thread or in a process of its own.

use std::time::Duration;

use crate::behavior_host::BehaviorHost;
use crate::bus::WaitSet;
use crate::device_host::DeviceHost;
use crate::reporter::PluginReporter;
use crate::tuner::Tuner;
use yamabico_core::message::PluginState;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::{Time, TimeSource};

/// Longest wait of a behavior; bounds the delay until it notices the end of the run.
const MAX_WAIT: Duration = Duration::from_millis(50);
/// Longest wait of a device; its drive checks its watchdog at least this often.
const MAX_DEVICE_WAIT: Duration = Duration::from_millis(10);

/// Calls one behavior whenever an input arrives or its period is over, until `is_over`. Applies new parameters between
/// calls.
pub fn run_behavior(
    host: &mut BehaviorHost,
    wait_set: &mut WaitSet,
    reporter: &mut PluginReporter,
    is_over: &dyn Fn() -> bool,
) {
    let max_wait = MAX_WAIT.min(reporter.heartbeat_period());
    host.set_time_source(TimeSource::Machine);
    host.log_calls(reporter.bus());
    let mut tuner = Tuner::open(host, reporter.bus());
    while !is_over() {
        if let Some(tuner) = &mut tuner {
            tuner.step(host);
        }
        let collected = host.collect();
        // Read after collecting, so that no input is newer.
        let now = Time::monotonic_now();
        let state = if host.sleeps() { PluginState::Sleeping } else { PluginState::Running };
        reporter.publish_heartbeat(state, now);
        let called = collected.and_then(|()| host.propose(now));
        reporter.publish_saved_state(host.saved_state(), now);
        reporter.publish_calls(host.stats(), now);
        let timeout = host.next_call().map_or(max_wait, |at| at.since(Time::monotonic_now()).min(max_wait));
        match called {
            Ok(()) => wait(wait_set, timeout),
            Err(error) => {
                // The arbiter handles the missing proposal; the next cycle tries again.
                tracing::error!("behavior `{}`: {error}", host.name());
                std::thread::sleep(max_wait);
            }
        }
    }
    reporter.publish_final_calls(host.stats(), Time::monotonic_now());
}

/// Polls the sensors of one device when they are due and passes every command to its drive, until `is_over`, whatever
/// fails. Reports the first failure.
pub fn run_device(
    host: &mut DeviceHost,
    wait_set: &mut WaitSet,
    reporter: &mut PluginReporter,
    is_over: &dyn Fn() -> bool,
) {
    reporter.publish_walls(host.walls(), Time::monotonic_now());
    let mut has_failed = false;
    let mut report = |error: DeviceError, reporter: &mut PluginReporter| {
        if !std::mem::replace(&mut has_failed, true) {
            reporter.publish_failure("", &error.to_string(), Time::monotonic_now());
        }
    };
    let has_sensors = host.has_sensors();
    let mut state = PluginState::Running;
    let max_wait = MAX_DEVICE_WAIT.min(reporter.heartbeat_period());
    while !is_over() {
        reporter.publish_heartbeat(state, Time::monotonic_now());
        let polled = host.poll(Time::monotonic_now());
        let driven = host.drive(Time::monotonic_now());
        let timeout = match polled {
            Ok(Due::At(at)) => at.since(Time::monotonic_now()).min(max_wait),
            _ => max_wait,
        };
        if polled == Ok(Due::Ended) && has_sensors {
            state = PluginState::Ended;
        }
        for error in [polled.err(), driven.err()].into_iter().flatten() {
            report(error, reporter);
        }
        wait(wait_set, timeout);
    }
    // The last command, a stop, may have arrived since.
    if let Err(error) = host.drive(Time::monotonic_now()) {
        report(error, reporter);
    }
}

/// Waits for a message, or for `timeout`.
fn wait(wait_set: &mut WaitSet, timeout: Duration) {
    if let Err(error) = wait_set.wait(timeout) {
        tracing::error!("waiting for messages failed: {error}");
        std::thread::sleep(timeout);
    }
}
