//! The loops of plugins that run live, each on a thread or in a process of its own.

use std::time::Duration;

use super::behavior::BehaviorSeat;
use super::device::DeviceSeat;
use super::pulse::Pulse;
use super::tuner::Tuner;
use crate::bus::Waiter;
use yamabico_core::message::PluginState;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::{Time, TimeSource};

/// Longest sleep of a behavior that nothing wakes: how late it notices the end of the run.
const NAP: Duration = Duration::from_millis(50);
/// Longest sleep of a device: its drive notices missing commands at least this often.
const DEVICE_NAP: Duration = Duration::from_millis(10);

/// Asks one behavior whenever something arrives for it, until `is_over`; changes its parameters in between.
pub fn behave(seat: &mut BehaviorSeat, waiter: &mut Waiter, pulse: &mut Pulse, is_over: &dyn Fn() -> bool) {
    let longest = NAP.min(pulse.every());
    seat.keep_time_by(TimeSource::Machine);
    let mut tuner = Tuner::open(seat, pulse.bus());
    while !is_over() {
        if let Some(tuner) = &mut tuner {
            tuner.step(seat);
        }
        let collected = seat.collect();
        // Nothing that is in is newer.
        let now = Time::monotonic_now();
        let state = if seat.sleeps() { PluginState::Sleeping } else { PluginState::Running };
        pulse.beat(state, now);
        let asked = collected.and_then(|()| seat.propose(now));
        pulse.tell_memory(seat.memory(), now);
        pulse.tell_calls(seat.record(), now);
        let sleep = seat.next_call().map_or(longest, |at| at.since(Time::monotonic_now()).min(longest));
        match asked {
            Ok(()) => nap(waiter, sleep),
            Err(error) => {
                // Its silence is the arbiter's to deal with; it tries again.
                tracing::error!("behavior `{}`: {error}", seat.name());
                std::thread::sleep(longest);
            }
        }
    }
    pulse.tell_last_calls(seat.record(), Time::monotonic_now());
}

/// Polls one device's sensors when they are due and hands its drive every command, until `is_over`, whatever fails; what
/// fails is told once.
pub fn operate(seat: &mut DeviceSeat, waiter: &mut Waiter, pulse: &mut Pulse, is_over: &dyn Fn() -> bool) {
    pulse.show_walls(seat.walls(), Time::monotonic_now());
    let mut failed = false;
    let mut tell = |error: DeviceError, pulse: &mut Pulse| {
        if !std::mem::replace(&mut failed, true) {
            pulse.fail("", &error.to_string(), Time::monotonic_now());
        }
    };
    let lasts = seat.measures();
    let mut state = PluginState::Running;
    let longest = DEVICE_NAP.min(pulse.every());
    while !is_over() {
        pulse.beat(state, Time::monotonic_now());
        let polled = seat.poll(Time::monotonic_now());
        let driven = seat.drive(Time::monotonic_now());
        let sleep = match polled {
            Ok(Due::At(at)) => at.since(Time::monotonic_now()).min(longest),
            _ => longest,
        };
        if polled == Ok(Due::Ended) && lasts {
            state = PluginState::Ended;
        }
        for error in [polled.err(), driven.err()].into_iter().flatten() {
            tell(error, pulse);
        }
        nap(waiter, sleep);
    }
    // What was commanded before the end is obeyed before the end.
    if let Err(error) = seat.drive(Time::monotonic_now()) {
        tell(error, pulse);
    }
}

/// Sleeps until something arrives, or for so long; where the waiter fails, for so long.
fn nap(waiter: &mut Waiter, longest: Duration) {
    if let Err(error) = waiter.wait(longest) {
        tracing::error!("what arrives wakes nobody: {error}");
        std::thread::sleep(longest);
    }
}
