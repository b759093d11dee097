//! Lockstep: simulated or recorded time. Every part acts once in a step, in a fixed order, so that the same run gives the same
//! bytes.

use std::collections::BTreeMap;
use std::time::Duration;

use yamabico_core::message::MessageType;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawPublisher, RawSubscriber};

use super::arbiter_host::ArbiterHost;
use super::hosted_behavior::{HostedBehavior, Hosting};
use super::plan::Plan;
use super::run_stats::RunStats;
use super::worker_pool::WorkerPool;
use crate::record::Tap;
use crate::supervisor::Program;
use yamabico_host::{DeviceHost, HostError};

/// A run in lockstep.
pub struct Lockstep {
    // Declared in this order: ports must be dropped before their bus.
    devices: Vec<DeviceHost>,
    workers: WorkerPool,
    arbiter: ArbiterHost,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    /// Publishers of recorded messages, by topic.
    fed: BTreeMap<String, RawPublisher>,
    now: Time,
    step: Duration,
    /// Plan, without what has been opened of it.
    plan: Plan,
    bus: Bus,
}

/// Life of a behavior before a replay takes it over.
#[derive(Clone, Debug, Default)]
pub(crate) struct Life {
    /// State that it saved last; empty if it saved none.
    pub saved_state: Vec<u8>,
    /// Number of its last proposal; zero before the first.
    pub sequence: u64,
}

/// State of the sensors of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorSupply {
    /// At least one sensor will measure again.
    Active,
    /// Every sensor has ended.
    Ended,
}

impl SensorSupply {
    /// State of `measuring` devices with sensors, of which `ended` have ended. A robot without sensors never ends.
    pub(super) fn of(measuring: usize, ended: usize) -> SensorSupply {
        if measuring > 0 && ended >= measuring { SensorSupply::Ended } else { SensorSupply::Active }
    }
}

impl Lockstep {
    /// Opens everything on a bus within this process; the first step is at time zero. Behaviors that are external programs
    /// become processes of `program`; without it they are refused.
    ///
    /// # Errors
    /// A device or behavior does not open.
    pub fn open(
        plan: Plan,
        step: Duration,
        threads: usize,
        program: Option<&Program>,
    ) -> Result<Lockstep, HostError> {
        let mut lockstep = Lockstep::open_arbiter(plan, step)?;
        lockstep.open_behaviors(threads, program, None)?;
        let devices = std::mem::take(&mut lockstep.plan.devices).into_iter();
        let devices = devices.map(|device| DeviceHost::open(device, &lockstep.bus));
        lockstep.devices = devices.collect::<Result<_, _>>()?;
        Ok(lockstep)
    }

    /// Opens the arbiter alone, for a replay that begins with recorded proposals.
    ///
    /// # Errors
    /// The bus fails.
    pub(crate) fn open_arbiter(plan: Plan, step: Duration) -> Result<Lockstep, HostError> {
        let plan = plan.with_saved_states();
        let bus = Bus::local("lockstep")?;
        plan.create_topics(&bus)?;
        Ok(Lockstep {
            devices: Vec::new(),
            workers: WorkerPool::empty(),
            taps: plan.taps(&bus)?,
            arbiter: ArbiterHost::open(&plan, &bus)?,
            fed: BTreeMap::new(),
            now: Time::ZERO,
            step,
            plan,
            bus,
        })
    }

    /// Opens every behavior with the state that it saved last. With a life, each takes part once it is resumed, and then has the
    /// newest message of every input, as after a restart.
    ///
    /// # Errors
    /// A behavior does not open.
    pub(crate) fn open_behaviors(
        &mut self,
        threads: usize,
        program: Option<&Program>,
        lives: Option<&BTreeMap<String, Life>>,
    ) -> Result<(), HostError> {
        // A topic of proposals admits one publisher.
        self.fed.clear();
        let hosting = Hosting { plan: &self.plan, bus: &self.bus, program, publishes_states: true };
        let behaviors = self.plan.behaviors.iter().map(|behavior| {
            let life = lives.and_then(|lives| lives.get(&behavior.setup.name));
            let saved_state = life.map_or(&[][..], |life| &life.saved_state);
            HostedBehavior::open(behavior.clone(), &hosting, saved_state)
        });
        self.workers = WorkerPool::new(behaviors.collect::<Result<_, _>>()?, threads, lives.is_none())?;
        self.arbiter.serve_new_subscribers();
        Ok(())
    }

    /// Lets these behaviors take part from the next step on.
    ///
    /// # Errors
    /// A thread died.
    pub(crate) fn resume(&mut self, lives: BTreeMap<String, Life>) -> Result<(), DeviceError> {
        self.workers.resume(lives)
    }

    /// Makes one step of the arbiter alone, with the proposals that have been fed; `tap` receives every message.
    ///
    /// # Errors
    /// The bus failed.
    pub(crate) fn decide(&mut self, tap: &mut dyn Tap) -> Result<(), DeviceError> {
        self.arbiter.step(self.now).map_err(bus_failed)?;
        self.show(tap)
    }

    /// Time of the next step.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Sets the time of the next step, for a replay.
    pub(crate) fn set_now(&mut self, now: Time) {
        self.now = now;
    }

    /// Publishes a recorded message for the next step, in place of the device or operator that published it.
    ///
    /// # Errors
    /// The plan has no such topic of this type, or the message is too long for it.
    pub(crate) fn feed(
        &mut self,
        topic: &str,
        message: &MessageType,
        header: &[u8],
        items: &[u8],
    ) -> Result<(), DeviceError> {
        if !self.fed.contains_key(topic) {
            let publisher = self.bus.publisher_raw(topic, message).map_err(bus_failed)?;
            self.fed.insert(topic.to_owned(), publisher);
        }
        self.fed[topic].publish(header, items).map_err(bus_failed)
    }

    /// Walls reported by the devices, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.devices.iter().flat_map(|device| device.walls().to_vec()).collect()
    }

    /// Brings the robot to a standstill for the end of the run.
    pub(crate) fn shut_down(&mut self) {
        self.arbiter.shut_down();
    }

    /// Makes one step: sensors that are due publish, behaviors propose, the arbiter decides, the drive applies the command,
    /// and `tap` receives every message. Then time advances. A failure does not keep the other parts from their turn.
    ///
    /// # Errors
    /// A device or the bus failed; the first of several failures.
    pub fn step(&mut self, tap: &mut dyn Tap) -> Result<SensorSupply, DeviceError> {
        let mut outcome = Ok(());
        let (mut measuring, mut ended) = (0, 0);
        for device in &mut self.devices {
            let polled = device.poll(self.now);
            measuring += usize::from(device.has_sensors());
            ended += usize::from(polled == Ok(Due::Ended) && device.has_sensors());
            outcome = outcome.and(polled.map(drop));
        }
        outcome = outcome.and(self.workers.collect()).and(self.workers.propose(self.now));
        outcome = outcome.and(self.arbiter.step(self.now).map_err(bus_failed));
        for device in &mut self.devices {
            outcome = outcome.and(device.drive(self.now));
        }
        outcome = outcome.and(self.show(tap));
        self.now = self.now + self.step;
        outcome.map(|()| SensorSupply::of(measuring, ended))
    }

    /// Passes `tap` what has been published since the last time.
    pub(crate) fn show(&self, tap: &mut dyn Tap) -> Result<(), DeviceError> {
        let mut outcome = Ok(());
        for (topic, message, subscriber) in &self.taps {
            outcome = outcome.and(loop {
                match subscriber.receive() {
                    Ok(Some(sample)) => {
                        tap.message(topic, message, self.now, sample.header(), sample.items());
                    }
                    Ok(None) => break Ok(()),
                    Err(error) => break Err(bus_failed(error)),
                }
            });
        }
        outcome
    }

    /// Number of messages that the taps lost to buffer overflow.
    pub fn lost(&self) -> u64 {
        self.taps.iter().map(|(.., subscriber)| subscriber.lost()).sum()
    }

    /// Ends the run and returns its statistics.
    pub fn finish(self) -> RunStats {
        let latencies = self.arbiter.latencies();
        RunStats { behaviors: self.workers.finish(), latencies, ..RunStats::default() }
    }
}

fn bus_failed(error: BusError) -> DeviceError {
    DeviceError::failed("bus", error)
}
