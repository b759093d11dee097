//! Simulated or replayed time: everybody acts once a step, in a fixed order, and the same run gives the same bytes.

use std::time::Duration;

use yamabico_core::message::MessageType;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawSubscriber};

use super::arbiter_seat::ArbiterSeat;
use super::crew::Crew;
use super::fared::Fared;
use super::plan::Plan;
use crate::record::Tap;
use yamabico_host::{BehaviorSeat, DeviceSeat, SeatError};

/// A run in lockstep.
pub struct Lockstep {
    // Ports go before the bus that they are on.
    devices: Vec<DeviceSeat>,
    crew: Crew,
    arbiter: ArbiterSeat,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    now: Time,
    step: Duration,
}

/// Whether the sensors of a run have anything left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supply {
    /// Some sensor will measure again.
    Lasting,
    /// Every sensor has ended.
    Ended,
}

impl Supply {
    /// Of so many devices that measure, of which so many have ended. A robot without sensors has nothing that could end.
    pub(super) fn of(measuring: usize, ended: usize) -> Supply {
        if measuring > 0 && ended >= measuring { Supply::Ended } else { Supply::Lasting }
    }
}

impl Lockstep {
    /// Opens everything on a bus within this process; the first step is at time zero.
    ///
    /// # Errors
    /// Devices or behaviors that do not open.
    pub fn open(plan: Plan, step: Duration, threads: usize) -> Result<Lockstep, SeatError> {
        let bus = Bus::local("lockstep")?;
        plan.create_topics(&bus)?;
        let taps = plan
            .topics
            .iter()
            .map(|topic| Ok((topic.name.clone(), topic.message, bus.tap(&topic.name, &topic.message)?)));
        let taps = taps.collect::<Result<_, BusError>>()?;
        let arbiter = ArbiterSeat::open(&plan, &bus)?;
        let seats = plan.behaviors.into_iter().map(|behavior| BehaviorSeat::open(behavior, &bus));
        let crew = Crew::new(seats.collect::<Result<_, _>>()?, threads)?;
        let devices = plan.devices.into_iter().map(|device| DeviceSeat::open(device, &bus));
        Ok(Lockstep {
            devices: devices.collect::<Result<_, _>>()?,
            crew,
            arbiter,
            taps,
            now: Time::ZERO,
            step,
        })
    }

    /// The time of the next step.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Walls that the devices know, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.devices.iter().flat_map(|device| device.walls().to_vec()).collect()
    }

    /// The arbiter.
    pub fn arbiter(&mut self) -> &mut ArbiterSeat {
        &mut self.arbiter
    }

    /// Sensors that are due publish, behaviors propose, the arbiter decides, the drive obeys, and `tap` is shown all of it.
    /// Then time advances. What fails keeps nobody else from their turn.
    ///
    /// # Errors
    /// A device failed, or the bus did; of several failures the first.
    pub fn step(&mut self, tap: &mut dyn Tap) -> Result<Supply, DeviceError> {
        let mut outcome = Ok(());
        let (mut measuring, mut ended) = (0, 0);
        for device in &mut self.devices {
            let polled = device.poll(self.now);
            measuring += usize::from(device.measures());
            ended += usize::from(polled == Ok(Due::Ended) && device.measures());
            outcome = outcome.and(polled.map(drop));
        }
        outcome = outcome.and(self.crew.collect()).and(self.crew.propose(self.now));
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
        outcome.map(|()| Supply::of(measuring, ended))
    }

    /// Messages that the taps have lost.
    pub fn lost(&self) -> u64 {
        self.taps.iter().map(|(.., subscriber)| subscriber.lost()).sum()
    }

    /// Ends the run; how its parts fared.
    pub fn finish(self) -> Fared {
        let latencies = self.arbiter.latencies();
        Fared { behaviors: self.crew.finish(), latencies, ..Fared::default() }
    }
}

fn bus_failed(error: BusError) -> DeviceError {
    DeviceError::failed("bus", error)
}
