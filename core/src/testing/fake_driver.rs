//! A driver whose behavior is given by closures.

use std::path::Path;
use std::sync::Arc;

use crate::behavior::ParameterError;
use crate::driver::{Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription};
use crate::message::{Message, MessageType};
use crate::parameters::schema_of;
use crate::sensor::{SensorInfo, SensorKind};

/// Closure that describes a sensor.
type Describe = dyn Fn(&PartSpec) -> Result<SensorDescription, ParameterError> + Send + Sync;
/// Closure that opens a device.
type Open = dyn Fn(DeviceSpec) -> Result<Device, ParameterError> + Send + Sync;
/// Closure that checks a sensor.
type Check = dyn Fn(&PartSpec, &Path) -> Result<(), ParameterError> + Send + Sync;

/// A driver whose devices are made by a closure, to test code that runs devices.
pub struct FakeDriver {
    info: DriverInfo,
    describe: Box<Describe>,
    check: Box<Check>,
    open: Box<Open>,
}

impl FakeDriver {
    /// Creates a driver that opens devices with `open`, without parameters, sensors or drives.
    pub fn new(
        name: &str,
        open: impl Fn(DeviceSpec) -> Result<Device, ParameterError> + Send + Sync + 'static,
    ) -> FakeDriver {
        let info = DriverInfo {
            name: name.to_owned(),
            summary: "Stands in for a device.".into(),
            parameters: schema_of::<NoParameters>(),
            files: Vec::new(),
            sensors: Vec::new(),
            drives: Vec::new(),
        };
        let describe = |sensor: &PartSpec| -> Result<SensorDescription, ParameterError> {
            Err(ParameterError::new("kind", format!("sensor `{}` is not described", sensor.name)))
        };
        FakeDriver {
            info,
            describe: Box::new(describe),
            check: Box::new(|_, _| Ok(())),
            open: Box::new(open),
        }
    }

    /// Modifies the driver's description.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut DriverInfo)) -> FakeDriver {
        change(&mut self.info);
        self
    }

    /// Sets the closure that describes a sensor.
    #[must_use]
    pub fn describing(
        mut self,
        describe: impl Fn(&PartSpec) -> Result<SensorDescription, ParameterError> + Send + Sync + 'static,
    ) -> FakeDriver {
        self.describe = Box::new(describe);
        self
    }

    /// Sets the closure that checks a sensor.
    #[must_use]
    pub fn checking(
        mut self,
        check: impl Fn(&PartSpec, &Path) -> Result<(), ParameterError> + Send + Sync + 'static,
    ) -> FakeDriver {
        self.check = Box::new(check);
        self
    }

    /// Returns the driver as a shared plugin.
    #[must_use]
    pub fn shared(self) -> Arc<dyn Driver> {
        Arc::new(self)
    }
}

impl Driver for FakeDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        (self.describe)(sensor)
    }

    fn check_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<(), ParameterError> {
        (self.check)(sensor, folder)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        (self.open)(spec)
    }
}

/// Parameters of a plugin without parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoParameters {}

/// Describes a sensor that publishes an `M` every `period_s` seconds without latency, with at most `max_item_bytes` of
/// items.
#[must_use]
pub fn plain_sensor<M: Message>(name: &str, period_s: f64, max_item_bytes: usize) -> SensorDescription {
    let message = MessageType::of::<M>().name;
    let info =
        SensorInfo { name: name.to_owned(), message, period_s, latency_s: 0.0, kind: SensorKind::Other };
    SensorDescription { info, max_item_bytes }
}
