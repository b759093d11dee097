//! A driver made of closures.

use std::path::Path;
use std::sync::Arc;

use crate::behavior::BuildError;
use crate::driver::{Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription};
use crate::message::{Message, MessageType};
use crate::parameters::schema_of;
use crate::sensor::{SensorInfo, SensorKind};

/// How a [`FakeDriver`] describes a sensor.
type Describe = dyn Fn(&PartSpec) -> Result<SensorDescription, BuildError> + Send + Sync;
/// How a [`FakeDriver`] opens a device.
type Open = dyn Fn(DeviceSpec) -> Result<Device, BuildError> + Send + Sync;
/// How a [`FakeDriver`] checks a sensor.
type Check = dyn Fn(&PartSpec, &Path) -> Result<(), BuildError> + Send + Sync;

/// A driver whose devices are made by a closure, for tests of whatever runs devices.
pub struct FakeDriver {
    info: DriverInfo,
    describe: Box<Describe>,
    check: Box<Check>,
    open: Box<Open>,
}

impl FakeDriver {
    /// A driver that opens devices by `open`, without parameters, sensors or drives.
    pub fn new(
        name: &str,
        open: impl Fn(DeviceSpec) -> Result<Device, BuildError> + Send + Sync + 'static,
    ) -> FakeDriver {
        let info = DriverInfo {
            name: name.to_owned(),
            summary: "Stands in for a device.".into(),
            parameters: schema_of::<NoParameters>(),
            files: Vec::new(),
            sensors: Vec::new(),
            drives: Vec::new(),
        };
        let describe = |sensor: &PartSpec| -> Result<SensorDescription, BuildError> {
            Err(BuildError::new("kind", format!("sensor `{}` is not described", sensor.name)))
        };
        FakeDriver {
            info,
            describe: Box::new(describe),
            check: Box::new(|_, _| Ok(())),
            open: Box::new(open),
        }
    }

    /// Changes the description.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut DriverInfo)) -> FakeDriver {
        change(&mut self.info);
        self
    }

    /// Describes its sensors by `describe`.
    #[must_use]
    pub fn describing(
        mut self,
        describe: impl Fn(&PartSpec) -> Result<SensorDescription, BuildError> + Send + Sync + 'static,
    ) -> FakeDriver {
        self.describe = Box::new(describe);
        self
    }

    /// Checks its sensors by `check`.
    #[must_use]
    pub fn checking(
        mut self,
        check: impl Fn(&PartSpec, &Path) -> Result<(), BuildError> + Send + Sync + 'static,
    ) -> FakeDriver {
        self.check = Box::new(check);
        self
    }

    /// The driver, to be named among the plugins.
    #[must_use]
    pub fn shared(self) -> Arc<dyn Driver> {
        Arc::new(self)
    }
}

impl Driver for FakeDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, BuildError> {
        (self.describe)(sensor)
    }

    fn check_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<(), BuildError> {
        (self.check)(sensor, folder)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, BuildError> {
        (self.open)(spec)
    }
}

/// The parameters of a plugin that has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoParameters {}

/// A sensor of messages `M` every `period_s` seconds, without latency, whose lists are at most `max_item_bytes` long.
#[must_use]
pub fn plain_sensor<M: Message>(name: &str, period_s: f64, max_item_bytes: usize) -> SensorDescription {
    let message = MessageType::of::<M>().name;
    let info =
        SensorInfo { name: name.to_owned(), message, period_s, latency_s: 0.0, kind: SensorKind::Other };
    SensorDescription { info, max_item_bytes }
}
