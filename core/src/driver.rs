//! The interface of a driver: the description of a family of devices, and the function that opens one.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use crate::behavior::ParameterError;
use crate::drive::Drive;
use crate::message::{Axes, Message, MessageType};
use crate::parameters::{FileKind, schema_of};
use crate::sensor::{Robot, Sensor, SensorInfo};

/// A family of devices that robot files can name.
pub trait Driver: Send + Sync {
    /// Static description of the driver.
    fn info(&self) -> &DriverInfo;

    /// Describes a sensor, whose parameters passed the schema check, to behaviors and to the bus. Relative paths in the
    /// parameters are resolved against `folder`.
    ///
    /// # Errors
    /// Parameters that contradict each other, with the key to change.
    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, ParameterError>;

    /// Checks that external resources named by the sensor's parameters, such as images, exist and are valid. Opens no
    /// device.
    ///
    /// # Errors
    /// The missing or invalid resource, with the key that names it.
    fn check_sensor(&self, _sensor: &PartSpec, _folder: &Path) -> Result<(), ParameterError> {
        Ok(())
    }

    /// Opens the device with its sensors and its drive.
    ///
    /// # Errors
    /// The part that does not open, with the key to change.
    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError>;
}

impl std::fmt::Debug for dyn Driver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.info().name)
    }
}

/// Static description of a driver.
#[derive(Clone, Debug)]
pub struct DriverInfo {
    /// Name in robot files, kebab-case.
    pub name: String,
    /// Purpose, one sentence.
    pub summary: String,
    /// JSON Schema of the device's own table.
    pub parameters: Json,
    /// Kinds of TOML file that the device's own table names; they are checked together with it.
    pub files: Vec<FileKind>,
    /// Kinds of sensor that its devices can have.
    pub sensors: Vec<SensorOffer>,
    /// Kinds of drive that its devices can have.
    pub drives: Vec<DriveOffer>,
}

impl DriverInfo {
    /// Returns the kind of sensor with this name, if any.
    #[must_use]
    pub fn sensor(&self, kind: &str) -> Option<&SensorOffer> {
        self.sensors.iter().find(|offer| offer.kind == kind)
    }

    /// Returns the kind of drive with this name, if any.
    #[must_use]
    pub fn drive(&self, kind: &str) -> Option<&DriveOffer> {
        self.drives.iter().find(|offer| offer.kind == kind)
    }
}

/// A kind of sensor that a driver provides.
#[derive(Clone, Debug)]
pub struct SensorOffer {
    /// Name in robot files, kebab-case.
    pub kind: String,
    /// Purpose, one sentence.
    pub summary: String,
    /// Type of message that it publishes.
    pub message: MessageType,
    /// JSON Schema of the parameters.
    pub parameters: Json,
}

impl SensorOffer {
    /// Creates a kind of sensor that publishes `M` and has the parameters `P`.
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

/// A kind of drive that a driver provides.
#[derive(Clone, Debug)]
pub struct DriveOffer {
    /// Name in robot files, kebab-case.
    pub kind: String,
    /// Purpose, one sentence.
    pub summary: String,
    /// Axes that it can move.
    pub axes: Axes,
    /// JSON Schema of the parameters.
    pub parameters: Json,
}

impl DriveOffer {
    /// Creates a kind of drive with these axes and the parameters `P`.
    #[must_use]
    pub fn new<P: JsonSchema>(kind: &str, summary: &str, axes: Axes) -> DriveOffer {
        DriveOffer { kind: kind.to_owned(), summary: summary.to_owned(), axes, parameters: schema_of::<P>() }
    }
}

/// Description of one sensor of a device, for behaviors and for the bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorDescription {
    /// Description that behaviors receive.
    pub info: SensorInfo,
    /// Maximum size of the item list of one message, bytes.
    pub max_item_bytes: usize,
}

/// Specification of a device to open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSpec {
    /// Name of the device in the robot file.
    pub name: String,
    /// The device's own table, checked against the driver's schema.
    pub table: toml::Table,
    /// Sensors to open.
    pub sensors: Vec<PartSpec>,
    /// Drive, if any.
    pub drive: Option<PartSpec>,
    /// Folder against which relative paths in the tables are resolved.
    pub folder: PathBuf,
    /// Seed of the run. A device derives the seeds of its random streams from it and from its own names.
    #[serde(with = "as_text")]
    pub seed: u64,
    /// The robot that carries the device.
    pub robot: Robot,
}

/// Specification of one sensor or drive of a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartSpec {
    /// Name in the robot file.
    pub name: String,
    /// Name of one of the driver's kinds.
    pub kind: String,
    /// Parameters, checked against the kind's schema.
    pub table: toml::Table,
}

/// An open device.
pub struct Device {
    /// Sensors by name, in the order of the specification.
    pub sensors: Vec<(String, Box<dyn Sensor>)>,
    /// Drive, if any.
    pub drive: Option<Box<dyn Drive>>,
    /// Publisher of a simulator's ground truth, a [`Truth`](crate::message::Truth) on the output `truth`. Used to score
    /// a run only.
    pub ground_truth: Option<Box<dyn Sensor>>,
    /// Walls known to a simulator, as polylines on the floor in the map frame, m. Used for plots only.
    pub walls: Vec<Vec<[f64; 2]>>,
}

/// Serializes integers as text, since TOML has no unsigned 64-bit integers.
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
