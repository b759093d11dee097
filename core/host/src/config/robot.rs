//! A checked robot file.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use super::tables::{Clock, Isolation};
use crate::Scheduling;
use yamabico_core::drive::Wheels;
use yamabico_core::driver::{DeviceSpec, Driver, PartSpec};
use yamabico_core::message::Axes;
use yamabico_core::sensor::{Robot, SensorInfo};

/// What a robot file says: devices, sensors, drive, footprint and limits.
#[derive(Clone, Debug)]
pub struct RobotFile {
    /// Where it was read from.
    pub path: PathBuf,
    /// Name, footprint, limits and axes, as behaviors see them.
    pub robot: Robot,
    /// Whose clock counts while it runs live.
    pub clock: Clock,
    /// Every device, in the order of the file.
    pub devices: Vec<DeviceFile>,
    /// Every sensor, in the order of the file.
    pub sensors: Vec<SensorFile>,
    /// The drive.
    pub drive: DriveFile,
}

/// A device of a robot file.
#[derive(Clone, Debug)]
pub struct DeviceFile {
    /// Its name.
    pub name: String,
    /// What opens it.
    pub driver: Arc<dyn Driver>,
    /// The driver's own keys, checked against its schema.
    pub table: toml::Table,
    /// Where it runs while the robot runs live.
    pub isolation: Isolation,
    /// A process of it that shows no sign of life for longer hangs.
    pub patience: Duration,
    /// What is asked of the system's scheduler for it.
    pub scheduling: Scheduling,
    /// The program that it is, and its arguments; empty where it is a part of this one.
    pub exec: Vec<String>,
}

/// A sensor of a robot file.
#[derive(Clone, Debug)]
pub struct SensorFile {
    /// Its device.
    pub device: String,
    /// Name, kind and checked keys.
    pub part: PartSpec,
    /// What behaviors are told about it.
    pub info: SensorInfo,
    /// The longest list in one of its messages, bytes.
    pub max_item_bytes: usize,
    /// Whether the robot must not move without it.
    pub critical: bool,
    /// Age of its newest measurement from which on it counts as dead: as written, or three periods and its latency.
    pub max_age: Duration,
}

/// The drive of a robot file.
#[derive(Clone, Debug)]
pub struct DriveFile {
    /// Its device.
    pub device: String,
    /// Name (`drive`), kind and checked keys.
    pub part: PartSpec,
    /// The axes that it has.
    pub axes: Axes,
    /// Its wheels, where the file tells: two for a drive that goes ahead and turns, three or four for one that goes sideways.
    pub wheels: Option<Wheels>,
}

impl RobotFile {
    /// The sensor of this name.
    pub fn sensor(&self, name: &str) -> Option<&SensorFile> {
        self.sensors.iter().find(|sensor| sensor.part.name == name)
    }

    /// Every device with all that belongs to it, ready to open; `seed` is the run's.
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
