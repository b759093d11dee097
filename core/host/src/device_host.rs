//! Host of one device: polls its sensors when they are due, and passes every command to its drive.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use crate::HostSettings;
use crate::bus::{Bus, BusError, Subscriber};
use crate::error::HostError;
use crate::output_ports::OutputPorts;
use crate::topics;
use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, Driver};
use yamabico_core::message::{Command, MessageType, Truth};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

/// Everything that is needed to host a device.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// Plugin that opens it.
    pub driver: Arc<dyn Driver>,
    /// Description of the device, from the robot file.
    pub spec: DeviceSpec,
    /// Name and message type of each of its sensors.
    pub sensors: Vec<(String, MessageType)>,
    /// Settings that the framework applies.
    pub settings: HostSettings,
}

/// An open device with its topics on the bus.
pub struct DeviceHost {
    device: Device,
    sensors: Vec<SensorPort>,
    ground_truth: Option<SensorPort>,
    commands: Option<Subscriber<Command>>,
}

/// Output of one sensor, and the time of its next measurement.
struct SensorPort {
    outputs: OutputPorts,
    due: Due,
}

impl DeviceHost {
    /// Opens the device and its topics.
    ///
    /// # Errors
    /// The driver cannot open the device, or a topic cannot be opened.
    pub fn open(plan: DevicePlan, bus: &Bus) -> Result<DeviceHost, HostError> {
        let name = plan.spec.name.clone();
        let device =
            plan.driver.open(plan.spec).map_err(|reason| HostError::Device { device: name, reason })?;
        let port = |name: &str, topic: String, message: MessageType| -> Result<SensorPort, BusError> {
            Ok(SensorPort {
                outputs: OutputPorts::open(bus, &[(name.to_owned(), topic, message)])?,
                due: Due::At(Time::ZERO),
            })
        };
        let sensors = plan.sensors.iter().map(|(name, message)| port(name, topics::sensor(name), *message));
        let sensors = sensors.collect::<Result<_, _>>()?;
        let ground_truth = match device.ground_truth {
            Some(_) => Some(port(topics::TRUTH, topics::TRUTH.to_owned(), MessageType::of::<Truth>())?),
            None => None,
        };
        let commands = match device.drive {
            Some(_) => Some(bus.subscriber(topics::COMMAND)?),
            None => None,
        };
        Ok(DeviceHost { device, sensors, ground_truth, commands })
    }

    /// Walls of a simulated world as polylines in the map frame, m, for plots; empty for a real device.
    pub fn walls(&self) -> &[Vec<[f64; 2]>] {
        &self.device.walls
    }

    /// Returns true if the device has sensors; a device may consist of a drive only.
    pub fn has_sensors(&self) -> bool {
        !self.sensors.is_empty() || self.ground_truth.is_some()
    }

    /// Polls every sensor that is due. Returns the time of the next measurement, or [`Due::Ended`] after the last one.
    /// A sensor that fails or panics is not polled again; the others continue.
    ///
    /// # Errors
    /// A sensor failed.
    pub fn poll(&mut self, now: Time) -> Result<Due, DeviceError> {
        let sensors = self.device.sensors.iter_mut().map(|(name, sensor)| (name.as_str(), sensor));
        let truth = self.device.ground_truth.as_mut().map(|truth| (topics::TRUTH, truth));
        let mut outcome = Ok(Due::Ended);
        for ((name, sensor), port) in
            sensors.zip(&mut self.sensors).chain(truth.zip(self.ground_truth.as_mut()))
        {
            let polled = port.poll(name, sensor.as_mut(), now);
            outcome = outcome.and_then(|next| Ok(earlier(next, polled?)));
        }
        outcome
    }

    /// Applies the newest command since the last call; without one, lets the drive check its watchdog.
    ///
    /// # Errors
    /// The drive or the bus failed.
    pub fn drive(&mut self, now: Time) -> Result<(), DeviceError> {
        let (Some(drive), Some(commands)) = (&mut self.device.drive, &mut self.commands) else {
            return Ok(());
        };
        let mut newest = None;
        let received = loop {
            match commands.receive() {
                Ok(Some(sample)) => newest = Some(*sample.header()),
                Ok(None) => break Ok(()),
                Err(error) => break Err(DeviceError::failed("drive", error)),
            }
        };
        drive.apply(newest.as_ref(), now).and(received)
    }

    /// Stops the drive with its emergency deceleration, whatever was commanded.
    ///
    /// # Errors
    /// The drive failed.
    pub fn stop(&mut self, now: Time) -> Result<(), DeviceError> {
        let Some(drive) = &mut self.device.drive else { return Ok(()) };
        let stop = Command { stamp_ns: now.0, evidence_ns: now.0, emergency: 1, ..Command::default() };
        drive.apply(Some(&stop), now)
    }
}

impl SensorPort {
    fn poll(&mut self, name: &str, sensor: &mut dyn Sensor, now: Time) -> Result<Due, DeviceError> {
        if matches!(self.due, Due::At(at) if at <= now) {
            self.due = Due::Ended;
            let outputs = &mut self.outputs;
            let polled = catch_unwind(AssertUnwindSafe(|| sensor.poll(now, &mut Outputs::new(outputs))));
            self.due = polled.unwrap_or_else(|panic| Err(DeviceError::failed(name, panic_text(&*panic))))?;
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

/// Describes a caught panic for an error message.
pub fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("panicked: {}; please report this", text.unwrap_or("no message"))
}
