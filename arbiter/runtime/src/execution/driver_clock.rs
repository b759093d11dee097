//! The arbiter of a run with a driver's clock: each step waits for every behavior.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use yamabico_core::message::{Clock, Name, StepPhase, StepSignal};
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber, WaitSet};
use yamabico_host::topics;

use super::arbiter_host::ArbiterHost;
use super::plan::Plan;

/// Longest wait without a look at the end of the run.
const MAX_WAIT: Duration = Duration::from_millis(20);
/// Time within which the first step comes, since a simulator builds its world first.
const FIRST_STEP_TIMEOUT: Duration = Duration::from_secs(10);

/// Time of the driver's clock, for other threads.
#[derive(Debug, Default)]
pub(super) struct DriverTime {
    first: AtomicU64,
    now: AtomicU64,
}

/// Announces the phases of each step and waits for the behaviors to complete them.
pub(super) struct StepCoordinator {
    clock: Subscriber<Clock>,
    signals: Publisher<StepSignal>,
    answers: Subscriber<StepSignal>,
    wait_set: WaitSet,
    followers: Vec<Follower>,
    device: String,
    timeout: Duration,
    sequence: u64,
    last: Option<Clock>,
}

/// A behavior that follows the steps.
struct Follower {
    name: Name,
    timeout: Duration,
    /// Set if the step waits for it: it completed the last phase, or has completed one since.
    is_awaited: bool,
    is_done: bool,
}

impl DriverTime {
    /// Instants of the first and of the newest step.
    pub fn read(&self) -> (Time, Time) {
        (Time(self.first.load(Ordering::Relaxed)), Time(self.now.load(Ordering::Relaxed)))
    }

    fn advance(&self, now: Time, is_first: impl FnOnce() -> bool) {
        if is_first() {
            self.first.store(now.0, Ordering::Relaxed);
        }
        self.now.store(now.0, Ordering::Relaxed);
    }
}

impl StepCoordinator {
    /// Opens the coordinator of a robot with one device, which owns the clock.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<StepCoordinator, BusError> {
        let device = plan.devices.first();
        let follower = |behavior: &yamabico_host::BehaviorPlan| Follower {
            name: Name::new(&behavior.setup.name),
            timeout: behavior.settings.host.deadline.hang_timeout(),
            is_awaited: true,
            is_done: false,
        };
        Ok(StepCoordinator {
            clock: bus.subscriber(topics::CLOCK)?,
            signals: bus.publisher(topics::STEP_ANNOUNCEMENTS)?,
            answers: bus.subscriber(topics::STEP_ACKNOWLEDGMENTS)?,
            wait_set: bus.wait_set(&[topics::CLOCK, topics::STEP_ACKNOWLEDGMENTS])?,
            followers: plan.behaviors.iter().map(follower).collect(),
            device: device.map(|device| device.spec.name.clone()).unwrap_or_default(),
            timeout: device.map_or(FIRST_STEP_TIMEOUT, |device| device.settings.deadline.hang_timeout()),
            sequence: 0,
            last: None,
        })
    }

    /// Decides at each step of the driver, until `is_over`. If its clock jumps, or stands still for longer than the driver's
    /// deadline, the failure is reported and the robot is brought to a standstill by the machine's clock.
    pub fn arbitrate(
        mut self,
        host: &mut ArbiterHost,
        period: Duration,
        time: &DriverTime,
        is_over: &dyn Fn() -> bool,
        stops: &dyn Fn() -> bool,
        fail: &dyn Fn(DeviceError),
    ) {
        // Behaviors begin with the first command.
        if let Err(error) = host.step(Time::ZERO) {
            fail(DeviceError::failed("arbiter", error));
        }
        while !is_over() {
            if stops() {
                host.shut_down();
            }
            match self.step(host, time, is_over) {
                Ok(()) => {}
                Err(problem) => {
                    fail(DeviceError::failed(&self.device, problem));
                    self.stop_robot(host, period, time, is_over);
                }
            }
        }
    }

    /// Makes one step if the driver makes one; the error describes what is wrong with its clock.
    fn step(
        &mut self,
        host: &mut ArbiterHost,
        time: &DriverTime,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), String> {
        let describe = |error: BusError| error.to_string();
        let Some(clock) = self.next(is_over)? else { return Ok(()) };
        let now = Time(clock.stamp_ns);
        time.advance(now, || self.last.is_none());
        self.last = Some(clock);
        for phase in [StepPhase::Collect, StepPhase::Propose] {
            self.call(&clock, phase).map_err(describe)?;
            self.wait_for_all(&clock, phase, is_over).map_err(describe)?;
        }
        host.step(now).map_err(describe)?;
        self.call(&clock, StepPhase::Done).map_err(describe)
    }

    /// Waits for the next instant; `None` if the run is over before.
    fn next(&mut self, is_over: &dyn Fn() -> bool) -> Result<Option<Clock>, String> {
        let begun = Instant::now();
        let timeout = if self.last.is_some() { self.timeout } else { FIRST_STEP_TIMEOUT };
        while !is_over() {
            if let Some(clock) = self.clock.receive().map_err(|error| error.to_string())? {
                let clock = *clock.header();
                let follows = |last: &Clock| clock.step == last.step + 1 && clock.stamp_ns > last.stamp_ns;
                return match &self.last {
                    Some(last) if !follows(last) => Err(format!(
                        "its clock went from step {} at {} ns to step {} at {} ns; each step must increase both, the step by 1",
                        last.step, last.stamp_ns, clock.step, clock.stamp_ns
                    )),
                    _ => Ok(Some(clock)),
                };
            }
            if begun.elapsed() > timeout {
                return Err(format!(
                    "its clock did not advance for {timeout:?}: raise `deadline_ms` of the device if a step may take longer"
                ));
            }
            self.wait_set.wait(MAX_WAIT).map_err(|error| error.to_string())?;
        }
        Ok(None)
    }

    fn call(&mut self, clock: &Clock, phase: StepPhase) -> Result<(), BusError> {
        self.followers.iter_mut().for_each(|follower| follower.is_done = false);
        self.sequence += 1;
        let signal = StepSignal {
            stamp_ns: clock.stamp_ns,
            sequence: self.sequence,
            step: clock.step,
            phase: phase.code(),
            ..StepSignal::default()
        };
        self.signals.publish(&signal, &[])
    }

    /// Waits until every behavior has completed the phase. A behavior that exceeds its deadline is no longer waited for until
    /// it completes a phase again.
    fn wait_for_all(
        &mut self,
        clock: &Clock,
        phase: StepPhase,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), BusError> {
        let begun = Instant::now();
        while !is_over() {
            while let Some(signal) = self.answers.receive()? {
                let signal = signal.header();
                let fits = signal.step == clock.step && signal.phase() == Some(phase);
                let follower = self.followers.iter_mut().find(|follower| follower.name == signal.plugin);
                if let Some(follower) = follower.filter(|_| fits) {
                    (follower.is_done, follower.is_awaited) = (true, true);
                }
            }
            let waited = begun.elapsed();
            let missing =
                self.followers.iter_mut().filter(|follower| follower.is_awaited && !follower.is_done);
            for follower in missing.filter(|follower| waited > follower.timeout) {
                tracing::warn!(
                    "step {} continues without `{}`, which did not answer in time",
                    clock.step,
                    follower.name
                );
                follower.is_awaited = false;
            }
            if self.followers.iter().all(|follower| follower.is_done || !follower.is_awaited) {
                break;
            }
            self.wait_set.wait(MAX_WAIT)?;
        }
        Ok(())
    }

    /// Brings the robot to a standstill without the driver: time goes on from its last instant by the machine's clock.
    fn stop_robot(
        &self,
        host: &mut ArbiterHost,
        period: Duration,
        time: &DriverTime,
        is_over: &dyn Fn() -> bool,
    ) {
        let (begun, (_, last)) = (Instant::now(), time.read());
        host.shut_down();
        while !is_over() {
            let now = last + self.timeout + begun.elapsed();
            time.advance(now, || false);
            if let Err(error) = host.step(now) {
                tracing::error!("could not publish the stop command: {error}");
            }
            std::thread::sleep(period);
        }
    }
}
