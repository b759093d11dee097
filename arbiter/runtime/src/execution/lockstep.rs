//! Lockstep: simulated or recorded time. Every part acts once in a step, in a fixed order, so that the same run gives the same
//! bytes.

use std::collections::BTreeMap;
use std::time::Duration;

use yamabico_core::message::MessageType;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawPublisher, RawSubscriber};

use super::arbiter_host::ArbiterHost;
use super::plan::Plan;
use super::run_stats::RunStats;
use super::worker_pool::WorkerPool;
use crate::record::Tap;
use yamabico_host::{BehaviorHost, DeviceHost, HostError};

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
    bus: Bus,
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
    /// Opens everything on a bus within this process; the first step is at time zero.
    ///
    /// # Errors
    /// A device or behavior does not open.
    pub fn open(plan: Plan, step: Duration, threads: usize) -> Result<Lockstep, HostError> {
        let bus = Bus::local("lockstep")?;
        plan.create_topics(&bus)?;
        let taps = plan.taps(&bus)?;
        let arbiter = ArbiterHost::open(&plan, &bus)?;
        let behaviors = plan.behaviors.into_iter().map(|behavior| BehaviorHost::open(behavior, &bus));
        let workers = WorkerPool::new(behaviors.collect::<Result<_, _>>()?, threads)?;
        let devices = plan.devices.into_iter().map(|device| DeviceHost::open(device, &bus));
        Ok(Lockstep {
            devices: devices.collect::<Result<_, _>>()?,
            workers,
            arbiter,
            taps,
            fed: BTreeMap::new(),
            now: Time::ZERO,
            step,
            bus,
        })
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
        self.now = self.now + self.step;
        outcome.map(|()| SensorSupply::of(measuring, ended))
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
