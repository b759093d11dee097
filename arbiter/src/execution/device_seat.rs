//! A device at work: its sensors polled when they are due, its drive given every command.

use yamabico_core::behavior::Outputs;
use yamabico_core::bus::{Bus, BusError, Subscriber};
use yamabico_core::message::{Command, MessageType, Truth};
use yamabico_core::sensor::{Device, DeviceError, DeviceSpec, DriverPlugin, Due, Sensor};
use yamabico_core::time::Time;

use super::behavior_seat::SeatError;
use super::ports::Ports;
use super::topics;

/// Everything needed to seat a device.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// What it is.
    pub plugin: DriverPlugin,
    /// What to open.
    pub spec: DeviceSpec,
    /// Name and type of what each of its sensors publishes.
    pub sensors: Vec<(String, MessageType)>,
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
        let device = (plan.plugin.open)(plan.spec)?;
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

    /// Lets every sensor that is due publish; tells when the next one is due, [`Due::Ended`] where none ever is again.
    ///
    /// # Errors
    /// The device failed.
    pub fn poll(&mut self, now: Time) -> Result<Due, DeviceError> {
        let mut next = Due::Ended;
        for ((_, sensor), seat) in self.device.sensors.iter_mut().zip(&mut self.sensors) {
            next = earlier(next, seat.poll(sensor.as_mut(), now)?);
        }
        if let (Some(judge), Some(seat)) = (&mut self.device.judge, &mut self.judge) {
            next = earlier(next, seat.poll(judge.as_mut(), now)?);
        }
        Ok(next)
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
        while let Some(sample) =
            commands.receive().map_err(|error| DeviceError::failed("drive", error.to_string()))?
        {
            newest = Some(*sample.header());
        }
        drive.apply(newest.as_ref(), now)
    }
}

impl SensorSeat {
    fn poll(&mut self, sensor: &mut dyn Sensor, now: Time) -> Result<Due, DeviceError> {
        if matches!(self.due, Due::At(at) if at <= now) {
            self.due = sensor.poll(now, &mut Outputs::new(&mut self.ports))?;
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
