//! A device at work: its sensors polled when they are due, its drive given every command.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use crate::bus::{Bus, BusError, Subscriber};
use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, Driver};
use yamabico_core::message::{Command, MessageType, Truth};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::behavior::{Hosting, SeatError};
use super::ports::Ports;
use super::topics;

/// Everything needed to seat a device.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// What it is.
    pub driver: Arc<dyn Driver>,
    /// What to open.
    pub spec: DeviceSpec,
    /// Name and type of what each of its sensors publishes.
    pub sensors: Vec<(String, MessageType)>,
    /// Live: where it runs, and how long it may show no sign of life.
    pub hosting: Hosting,
    /// The program that it is, and its arguments; empty where it is a part of this one.
    pub exec: Vec<String>,
}

/// A device between its sensors' ports and the commands.
pub struct DeviceSeat {
    device: Device,
    sensors: Vec<SensorSeat>,
    judge: Option<SensorSeat>,
    commands: Option<Subscriber<Command>>,
}

struct SensorSeat {
    ports: Ports,
    due: Due,
}

impl DeviceSeat {
    /// Opens the device and its channels.
    ///
    /// # Errors
    /// A device that does not open, or channels that do not.
    pub fn open(plan: DevicePlan, bus: &Bus) -> Result<DeviceSeat, SeatError> {
        let name = plan.spec.name.clone();
        let device =
            plan.driver.open(plan.spec).map_err(|reason| SeatError::Device { device: name, reason })?;
        let seat = |name: &str, topic: String, message: MessageType| -> Result<SensorSeat, BusError> {
            Ok(SensorSeat {
                ports: Ports::open(bus, &[(name.to_owned(), topic, message)])?,
                due: Due::At(Time::ZERO),
            })
        };
        let sensors = plan.sensors.iter().map(|(name, message)| seat(name, topics::sensor(name), *message));
        let sensors = sensors.collect::<Result<_, _>>()?;
        let judge = match device.judge {
            Some(_) => Some(seat(topics::TRUTH, topics::TRUTH.to_owned(), MessageType::of::<Truth>())?),
            None => None,
        };
        let commands = match device.drive {
            Some(_) => Some(bus.subscriber(topics::COMMAND)?),
            None => None,
        };
        Ok(DeviceSeat { device, sensors, judge, commands })
    }

    /// Walls that the device knows, for plots.
    pub fn walls(&self) -> &[Vec<[f64; 2]>] {
        &self.device.walls
    }

    /// Whether there is anything to poll; a device may be a drive alone.
    pub fn measures(&self) -> bool {
        !self.sensors.is_empty() || self.judge.is_some()
    }

    /// Lets every sensor that is due publish; tells when the next one is due, [`Due::Ended`] where none ever is again. A
    /// sensor that fails or panics is not asked again; the others go on.
    ///
    /// # Errors
    /// A sensor failed.
    pub fn poll(&mut self, now: Time) -> Result<Due, DeviceError> {
        let sensors = self.device.sensors.iter_mut().map(|(name, sensor)| (name.as_str(), sensor));
        let judge = self.device.judge.as_mut().map(|judge| (topics::TRUTH, judge));
        let mut outcome = Ok(Due::Ended);
        for ((name, sensor), seat) in sensors.zip(&mut self.sensors).chain(judge.zip(self.judge.as_mut())) {
            let polled = seat.poll(name, sensor.as_mut(), now);
            outcome = outcome.and_then(|next| Ok(earlier(next, polled?)));
        }
        outcome
    }

    /// Gives the drive what has been commanded since the last call, or nothing.
    ///
    /// # Errors
    /// The drive does not obey, or the bus failed.
    pub fn drive(&mut self, now: Time) -> Result<(), DeviceError> {
        let (Some(drive), Some(commands)) = (&mut self.device.drive, &mut self.commands) else {
            return Ok(());
        };
        let mut newest = None;
        let heard = loop {
            match commands.receive() {
                Ok(Some(sample)) => newest = Some(*sample.header()),
                Ok(None) => break Ok(()),
                Err(error) => break Err(DeviceError::failed("drive", error)),
            }
        };
        drive.apply(newest.as_ref(), now).and(heard)
    }

    /// Stops the drive with its emergency deceleration, whatever has been commanded.
    ///
    /// # Errors
    /// The drive does not obey.
    pub fn brake(&mut self, now: Time) -> Result<(), DeviceError> {
        let Some(drive) = &mut self.device.drive else { return Ok(()) };
        let stop = Command { stamp_ns: now.0, evidence_ns: now.0, emergency: 1, ..Command::default() };
        drive.apply(Some(&stop), now)
    }
}

impl SensorSeat {
    fn poll(&mut self, name: &str, sensor: &mut dyn Sensor, now: Time) -> Result<Due, DeviceError> {
        if matches!(self.due, Due::At(at) if at <= now) {
            self.due = Due::Ended;
            let ports = &mut self.ports;
            let polled = catch_unwind(AssertUnwindSafe(|| sensor.poll(now, &mut Outputs::new(ports))));
            self.due = polled.unwrap_or_else(|panic| Err(DeviceError::failed(name, panicked(&*panic))))?;
        }
        Ok(self.due)
    }
}

fn earlier(a: Due, b: Due) -> Due {
    match (a, b) {
        (Due::At(a), Due::At(b)) => Due::At(a.min(b)),
        (Due::Ended, other) | (other, Due::Ended) => other,
    }
}

/// What a panic said, for people.
pub fn panicked(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}; please report this", text.unwrap_or("without words"))
}
