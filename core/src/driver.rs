//! The seam that a family of devices implements: its description, and a way to open one.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use crate::behavior::BuildError;
use crate::drive::Drive;
use crate::message::{Axes, Message, MessageType};
use crate::parameters::{FileKind, schema_of};
use crate::sensor::{Robot, Sensor, SensorInfo};

/// A family of devices that robot files can name.
pub trait Driver: Send + Sync {
    /// The description.
    fn info(&self) -> &DriverInfo;

    /// What behaviors and the bus must know of a sensor whose parameters have passed the schema. Relative paths in them
    /// start at `folder`.
    ///
    /// # Errors
    /// Parameters that contradict each other, with the key to change.
    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, BuildError>;

    /// Checks that whatever the sensor's parameters name outside the robot file, such as images, is there and fits. Opens
    /// no device.
    ///
    /// # Errors
    /// What is missing or does not fit, with the key that names it.
    fn check_sensor(&self, _sensor: &PartSpec, _folder: &Path) -> Result<(), BuildError> {
        Ok(())
    }

    /// Opens the device with its sensors and its drive.
    ///
    /// # Errors
    /// What does not open, with the key to change.
    fn open(&self, spec: DeviceSpec) -> Result<Device, BuildError>;
}

impl std::fmt::Debug for dyn Driver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.info().name)
    }
}

/// Everything known of a driver without opening a device.
#[derive(Clone, Debug)]
pub struct DriverInfo {
    /// Name in robot files, kebab-case.
    pub name: String,
    /// What it drives, in one sentence.
    pub summary: String,
    /// JSON Schema of the device's own table.
    pub parameters: Json,
    /// The TOML files that the device's own table names; they are checked with it.
    pub files: Vec<FileKind>,
    /// The kinds of sensor that it offers.
    pub sensors: Vec<SensorOffer>,
    /// The kinds of drive that it offers.
    pub drives: Vec<DriveOffer>,
}

impl DriverInfo {
    /// The kind of sensor of this name.
    #[must_use]
    pub fn sensor(&self, kind: &str) -> Option<&SensorOffer> {
        self.sensors.iter().find(|offer| offer.kind == kind)
    }

    /// The kind of drive of this name.
    #[must_use]
    pub fn drive(&self, kind: &str) -> Option<&DriveOffer> {
        self.drives.iter().find(|offer| offer.kind == kind)
    }
}

/// A kind of sensor that a driver offers.
#[derive(Clone, Debug)]
pub struct SensorOffer {
    /// Name in robot files, kebab-case.
    pub kind: String,
    /// What it measures, in one sentence.
    pub summary: String,
    /// The message that it publishes.
    pub message: MessageType,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

impl SensorOffer {
    /// A kind of sensor that publishes `M` and has the parameters `P`.
    #[must_use]
    pub fn new<M: Message, P: JsonSchema>(kind: &str, summary: &str) -> SensorOffer {
        SensorOffer {
            kind: kind.to_owned(),
            summary: summary.to_owned(),
            message: MessageType::of::<M>(),
            parameters: schema_of::<P>(),
        }
    }
}

/// A kind of drive that a driver offers.
#[derive(Clone, Debug)]
pub struct DriveOffer {
    /// Name in robot files, kebab-case.
    pub kind: String,
    /// What it moves, in one sentence.
    pub summary: String,
    /// The axes that it has.
    pub axes: Axes,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

impl DriveOffer {
    /// A kind of drive that has these axes and the parameters `P`.
    #[must_use]
    pub fn new<P: JsonSchema>(kind: &str, summary: &str, axes: Axes) -> DriveOffer {
        DriveOffer { kind: kind.to_owned(), summary: summary.to_owned(), axes, parameters: schema_of::<P>() }
    }
}

/// One sensor of a device, as behaviors and the bus must know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorDescription {
    /// What behaviors are told about it.
    pub info: SensorInfo,
    /// The longest list of items in one of its messages, bytes.
    pub max_item_bytes: usize,
}

/// What a driver is asked to open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSpec {
    /// The device's name in the robot file.
    pub name: String,
    /// The device's own table, checked against the driver's schema.
    pub table: toml::Table,
    /// Its sensors: name, kind and checked table.
    pub sensors: Vec<PartSpec>,
    /// Its drive.
    pub drive: Option<PartSpec>,
    /// Relative paths in the tables start here.
    pub folder: PathBuf,
    /// Of the run; a device derives its own streams from it and its names.
    #[serde(with = "as_text")]
    pub seed: u64,
    /// The robot that it is on.
    pub robot: Robot,
}

/// A sensor or a drive of a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartSpec {
    /// Name in the robot file.
    pub name: String,
    /// Which of the driver's kinds.
    pub kind: String,
    /// Its parameters, checked against the kind's schema.
    pub table: toml::Table,
}

/// An open device.
pub struct Device {
    /// Its sensors in the order asked for: name and sensor.
    pub sensors: Vec<(String, Box<dyn Sensor>)>,
    /// Its drive.
    pub drive: Option<Box<dyn Drive>>,
    /// A simulator's own sensor of [`Truth`](crate::message::Truth), published on the output `truth`.
    pub judge: Option<Box<dyn Sensor>>,
    /// Walls that a simulator knows, as polylines on the floor, map frame, meters: for plots.
    pub walls: Vec<Vec<[f64; 2]>>,
}

/// Whole numbers that TOML has no room for.
mod as_text {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(number: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(number)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}
