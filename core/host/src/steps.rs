//! Loops of plugins in a live run whose clock belongs to a driver, such as an external simulator.
//!
//! Time advances in steps of the driver. In each step
//! 1. the driver publishes its measurements and then the time of the step;
//! 2. the arbiter announces the phase `collect`: every behavior receives what has arrived, and acknowledges;
//! 3. the arbiter announces the phase `propose`: every behavior with new input proposes, and acknowledges;
//! 4. the arbiter decides, commands, and announces the phase `done`;
//! 5. the driver applies the command and begins the next step.
//!
//! The run therefore does not depend on the speed of the driver or the machine.

use std::time::Duration;

use crate::behavior_host::BehaviorHost;
use crate::bus::{Bus, BusError, Publisher, Subscriber, WaitSet};
use crate::device_host::DeviceHost;
use crate::reporter::PluginReporter;
use crate::topics;
use crate::tuner::Tuner;
use yamabico_core::message::{Clock, Name, PluginState, StepPhase, StepSignal};
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;

/// Longest wait; bounds the delay until the end of the run is noticed.
const MAX_WAIT: Duration = Duration::from_millis(50);

/// A behavior's end of the step protocol.
pub struct StepFollower {
    announcements: Subscriber<StepSignal>,
    acknowledgments: Publisher<StepSignal>,
    wait_set: WaitSet,
    name: Name,
    sequence: u64,
}

/// A driver's end of the step protocol.
pub struct StepLeader {
    clock: Publisher<Clock>,
    announcements: Subscriber<StepSignal>,
    wait_set: WaitSet,
    step: Duration,
}

impl StepFollower {
    /// Opens the topics for the behavior `name`.
    ///
    /// # Errors
    /// Topics that cannot be opened.
    pub fn open(bus: &Bus, name: &str) -> Result<StepFollower, BusError> {
        Ok(StepFollower {
            announcements: bus.subscriber(topics::STEP_ANNOUNCEMENTS)?,
            acknowledgments: bus.publisher(topics::STEP_ACKNOWLEDGMENTS)?,
            wait_set: bus.wait_set(&[topics::STEP_ANNOUNCEMENTS])?,
            name: Name::new(name),
            sequence: 0,
        })
    }

    fn acknowledge(&mut self, signal: StepSignal) -> Result<(), BusError> {
        self.sequence += 1;
        self.acknowledgments
            .publish(&StepSignal { plugin: self.name, sequence: self.sequence, ..signal }, &[])
    }
}

impl StepLeader {
    /// Opens the topics for a driver with steps of length `step`.
    ///
    /// # Errors
    /// Topics that cannot be opened.
    pub fn open(bus: &Bus, step: Duration) -> Result<StepLeader, BusError> {
        Ok(StepLeader {
            clock: bus.publisher(topics::CLOCK)?,
            announcements: bus.subscriber(topics::STEP_ANNOUNCEMENTS)?,
            wait_set: bus.wait_set(&[topics::STEP_ANNOUNCEMENTS])?,
            step,
        })
    }

    /// Returns true once the arbiter has announced that `step` is done.
    fn is_done(&self, step: u64) -> Result<bool, BusError> {
        while let Some(signal) = self.announcements.receive()? {
            if signal.header().step == step && signal.header().phase() == Some(StepPhase::Done) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Calls one behavior in the phases of each step, until `is_over`. Applies new parameters between calls.
pub fn follow_steps(
    host: &mut BehaviorHost,
    follower: &mut StepFollower,
    reporter: &mut PluginReporter,
    is_over: &dyn Fn() -> bool,
) {
    let max_wait = MAX_WAIT.min(reporter.heartbeat_period());
    host.log_calls(reporter.bus());
    let mut tuner = Tuner::open(host, reporter.bus());
    while !is_over() {
        if let Some(tuner) = &mut tuner {
            tuner.step(host);
        }
        reporter.publish_heartbeat(PluginState::Running, Time::monotonic_now());
        let called = run_phases(host, follower, reporter);
        reporter.publish_calls(host.stats(), Time::monotonic_now());
        let waited = called.and_then(|()| follower.wait_set.wait(max_wait));
        if let Err(error) = waited {
            // The arbiter handles the missing proposal; the next cycle tries again.
            tracing::error!("behavior `{}`: {error}", host.name());
            std::thread::sleep(max_wait);
        }
    }
    reporter.publish_final_calls(host.stats(), Time::monotonic_now());
}

fn run_phases(
    host: &mut BehaviorHost,
    follower: &mut StepFollower,
    reporter: &mut PluginReporter,
) -> Result<(), BusError> {
    loop {
        let Some(signal) = follower.announcements.receive()?.map(|signal| *signal.header()) else {
            return Ok(());
        };
        match signal.phase() {
            Some(StepPhase::Collect) => host.collect()?,
            Some(StepPhase::Propose) => {
                host.propose(Time(signal.stamp_ns))?;
                // Before the acknowledgment, so that the state of a step is known at its end.
                reporter.publish_saved_state(host.saved_state(), Time::monotonic_now());
            }
            Some(StepPhase::Done) | None => continue,
        }
        follower.acknowledge(signal)?;
    }
}

/// Steps one device as fast as the other plugins follow, until `is_over`.
///
/// # Errors
/// A sensor, the drive or the bus failed.
pub fn lead_steps(
    host: &mut DeviceHost,
    leader: &mut StepLeader,
    reporter: &mut PluginReporter,
    is_over: &dyn Fn() -> bool,
) -> Result<(), DeviceError> {
    let failed = |error: BusError| DeviceError::failed("clock", error);
    reporter.publish_walls(host.walls(), Time::monotonic_now());
    let (mut now, mut step, mut state) = (Time::ZERO, 0, PluginState::Running);
    while !is_over() {
        if host.poll(now)? == Due::Ended && host.has_sensors() {
            state = PluginState::Ended;
        }
        leader.clock.publish(&Clock { stamp_ns: now.0, step }, &[]).map_err(failed)?;
        loop {
            reporter.publish_heartbeat(state, Time::monotonic_now());
            if leader.is_done(step).map_err(failed)? || is_over() {
                break;
            }
            leader.wait_set.wait(MAX_WAIT.min(reporter.heartbeat_period())).map_err(failed)?;
        }
        host.drive(now)?;
        (now, step) = (now + leader.step, step + 1);
    }
    Ok(())
}
