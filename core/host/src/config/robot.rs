//! Checked robot file.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use super::tables::Clock;
use crate::HostSettings;
use yamabico_core::drive::Wheels;
use yamabico_core::driver::{DeviceSpec, Driver, PartSpec};
use yamabico_core::message::Axes;
use yamabico_core::sensor::{Robot, SensorInfo};

/// Checked robot file: devices, sensors, drive, footprint and limits.
#[derive(Clone, Debug)]
pub struct RobotFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Paths of the included files.
    pub parts: Vec<PathBuf>,
    /// Name, footprint, limits and axes for behaviors.
    pub robot: Robot,
    /// Source of time while the robot runs live.
    pub clock: Clock,
    /// Devices, in the order of the file.
    pub devices: Vec<DeviceFile>,
    /// Sensors, in the order of the file.
    pub sensors: Vec<SensorFile>,
    /// Drive.
    pub drive: DriveFile,
}

/// Device of a robot file.
#[derive(Clone, Debug)]
pub struct DeviceFile {
    /// Name in the robot file.
    pub name: String,
    /// Driver that opens it.
    pub driver: Arc<dyn Driver>,
    /// Parameters of the driver, checked against its schema.
    pub table: toml::Table,
    /// Settings that the framework applies.
    pub settings: HostSettings,
}

/// Sensor of a robot file.
#[derive(Clone, Debug)]
pub struct SensorFile {
    /// Name of its device.
    pub device: String,
    /// Name, kind and checked parameters.
    pub part: PartSpec,
    /// Description for behaviors.
    pub info: SensorInfo,
    /// Maximum size of the items of one message, bytes.
    pub max_item_bytes: usize,
    /// True if the robot stops without it.
    pub critical: bool,
    /// Age of its newest measurement above which it counts as dead.
    pub max_age: Duration,
}

/// Drive of a robot file.
#[derive(Clone, Debug)]
pub struct DriveFile {
    /// Name of its device.
    pub device: String,
    /// Name (`drive`), kind and checked parameters.
    pub part: PartSpec,
    /// Axes of the drive.
    pub axes: Axes,
    /// Wheels, if given: two for a differential drive, three or four for a holonomic one.
    pub wheels: Option<Wheels>,
}

impl RobotFile {
    /// Returns the sensor with this name.
    pub fn sensor(&self, name: &str) -> Option<&SensorFile> {
        self.sensors.iter().find(|sensor| sensor.part.name == name)
    }

    /// Returns the driver and specification of every device; `seed` is the seed of the run.
    pub fn specs(&self, seed: u64) -> Vec<(Arc<dyn Driver>, DeviceSpec)> {
        let folder = self.path.parent().map(PathBuf::from).unwrap_or_default();
        let spec = |device: &DeviceFile| {
            let of_device = self.sensors.iter().filter(|sensor| sensor.device == device.name);
            let spec = DeviceSpec {
                name: device.name.clone(),
                table: device.table.clone(),
                sensors: of_device.map(|sensor| sensor.part.clone()).collect(),
                drive: (self.drive.device == device.name).then(|| self.drive.part.clone()),
                folder: folder.clone(),
                seed,
                robot: self.robot.clone(),
            };
            (Arc::clone(&device.driver), spec)
        };
        self.devices.iter().map(spec).collect()
    }
}
