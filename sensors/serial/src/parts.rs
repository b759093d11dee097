//! Sensors and drives of a device on a line.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Command, Message};
use yamabico_core::parameters::schema_of;
use yamabico_core::sensor::{DeviceError, Due, Sensor, SensorInfo, SensorKind, check_real_time};
use yamabico_core::time::Time;

use crate::commanded::Commanded;
use crate::line::{Conversation, Line};

/// Time between two looks for new measurements.
const POLL_PERIOD: Duration = Duration::from_millis(5);
/// Number of measurements that wait for a look.
const MAX_WAITING: usize = 64;

/// Empty parameters, of a sensor without any.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// Measurements that wait to be published. Without a reader, the oldest are dropped.
#[derive(Clone, Debug)]
pub struct Outbox<T>(VecDeque<T>);

impl<T> Default for Outbox<T> {
    fn default() -> Self {
        Outbox(VecDeque::with_capacity(MAX_WAITING))
    }
}

impl<T> Outbox<T> {
    /// Adds a measurement.
    pub fn push(&mut self, measurement: T) {
        if self.0.len() >= MAX_WAITING {
            self.0.pop_front();
        }
        self.0.push_back(measurement);
    }

    /// Removes and returns the oldest measurement.
    pub fn pop(&mut self) -> Option<T> {
        self.0.pop_front()
    }
}

/// Conversation with a device that drives.
pub trait Base: Conversation {
    /// The command that it drives by.
    fn commanded(&mut self) -> &mut Commanded;
}

/// Access to the next measurement of a conversation: header and items.
pub type Take<C, M> = fn(&mut C) -> Option<(M, Vec<<M as Message>::Item>)>;

/// Sensor that publishes the measurements of a conversation.
pub struct LineSensor<C: Conversation, M: Message> {
    name: String,
    line: Arc<Line<C>>,
    take: Take<C, M>,
    has_begun: bool,
}

impl<C: Conversation, M: Message> LineSensor<C, M> {
    /// Returns the sensor `name`, which publishes what `take` takes.
    pub fn boxed(name: &str, line: &Arc<Line<C>>, take: Take<C, M>) -> (String, Box<dyn Sensor>)
    where
        M: Send + 'static,
    {
        let sensor = LineSensor { name: name.to_owned(), line: Arc::clone(line), take, has_begun: false };
        (name.to_owned(), Box::new(sensor))
    }
}

impl<C: Conversation, M: Message + Send> Sensor for LineSensor<C, M> {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        check_real_time(&self.name, now)?;
        // Measurements from before the run are old.
        let is_begin = !std::mem::replace(&mut self.has_begun, true);
        while let Some((header, items)) = self.line.with(self.take) {
            if !is_begin {
                outputs.publish(&self.name, &header, &items)?;
            }
        }
        Ok(Due::At(now + POLL_PERIOD))
    }
}

/// Drive that passes commands to a conversation, whose thread watches them.
pub struct LineDrive<C: Base>(pub Arc<Line<C>>);

impl<C: Base> Drive for LineDrive<C> {
    fn apply(&mut self, command: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        if let Some(command) = command {
            self.0.command(|base| base.commanded().set(command, Time::monotonic_now()));
        }
        // A lost line stops the robot by its own watchdog, and its stale sensors tell: the run goes on when it is back.
        Ok(())
    }
}

/// Driver of a family of devices on serial lines.
pub struct SerialDriver {
    info: DriverInfo,
    describe: fn(&PartSpec) -> Result<SensorDescription, ParameterError>,
    open: fn(&DeviceSpec) -> Result<Device, ParameterError>,
}

impl SerialDriver {
    /// Returns the driver `name` of devices with the parameters `P`.
    pub fn arc<P: JsonSchema>(
        name: &str,
        summary: &str,
        sensors: Vec<SensorOffer>,
        drives: Vec<DriveOffer>,
        describe: fn(&PartSpec) -> Result<SensorDescription, ParameterError>,
        open: fn(&DeviceSpec) -> Result<Device, ParameterError>,
    ) -> Arc<dyn Driver> {
        let info = DriverInfo {
            name: name.to_owned(),
            summary: summary.to_owned(),
            parameters: schema_of::<P>(),
            files: Vec::new(),
            sensors,
            drives,
        };
        Arc::new(SerialDriver { info, describe, open })
    }
}

impl Driver for SerialDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        (self.describe)(sensor)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        for (i, sensor) in spec.sensors.iter().enumerate() {
            if spec.sensors[..i].iter().any(|other| other.kind == sensor.kind) {
                let problem = format!("device `{}` has one sensor of the kind `{}`", spec.name, sensor.kind);
                return Err(ParameterError::new("kind", problem));
            }
        }
        (self.open)(&spec)
    }
}

/// Returns the description of a sensor that publishes `M` with up to `max_items` items.
pub(crate) fn description<M: Message>(
    name: &str,
    period_s: f64,
    latency_s: f64,
    kind: SensorKind,
    max_items: usize,
) -> SensorDescription {
    let info = SensorInfo { name: name.to_owned(), message: M::NAME, period_s, latency_s, kind };
    SensorDescription { info, max_item_bytes: max_items * size_of::<M::Item>() }
}

/// Returns the error of a kind of sensor that the driver does not offer.
pub(crate) fn no_sensor(kind: &str) -> ParameterError {
    ParameterError::new("kind", format!("the device has no sensor `{kind}`"))
}
