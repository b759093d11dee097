//! What a program tells of the driver that it is, before it runs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::charge::PROTOCOL;
use super::converse::converse;
use super::description::check_protocol;
use yamabico_core::behavior::BuildError;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Axes, MessageType};
use yamabico_core::sensor::SensorInfo;

/// The argument that asks for a [`SensorAnswer`]; the [`SensorQuestion`] is on standard input, as JSON.
pub const SENSOR: &str = "--sensor";

/// A driver in a program of its own, as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriverDescription {
    /// The protocol that the program speaks.
    pub protocol: u32,
    /// The driver's name.
    pub name: String,
    /// What it drives, in one sentence.
    pub summary: String,
    /// JSON Schema of the device's own table.
    pub parameters: Json,
    /// The kinds of sensor that it offers.
    pub sensors: Vec<SensorKindDescription>,
    /// The kinds of drive that it offers.
    pub drives: Vec<DriveKindDescription>,
}

/// A kind of sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorKindDescription {
    /// Name in robot files.
    pub kind: String,
    /// What it measures, in one sentence.
    pub summary: String,
    /// What it publishes, such as `yamabico.Odometry.v1`.
    pub message: String,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// A kind of drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveKindDescription {
    /// Name in robot files.
    pub kind: String,
    /// What it moves, in one sentence.
    pub summary: String,
    /// The axes that it has, such as `linear+angular`.
    pub axes: Axes,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// What is asked about a sensor whose table has passed the schema.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorQuestion {
    /// Its name in the robot file.
    pub name: String,
    /// Which of the program's kinds.
    pub kind: String,
    /// Its own keys, as far as they are written.
    pub table: toml::Table,
    /// Relative paths in it start here.
    pub folder: PathBuf,
}

/// What the program answers, as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensorAnswer {
    /// It is right.
    Sensor {
        /// What behaviors are told about it.
        info: SensorInfo,
        /// The longest list of items in one of its messages, bytes.
        most_bytes: usize,
    },
    /// It cannot be.
    Refused {
        /// The key to change, dotted; empty where none is to blame.
        key: String,
        /// What is wrong.
        problem: String,
    },
}

impl DriverDescription {
    /// That of a driver of this program.
    pub fn of(driver: &DriverInfo) -> DriverDescription {
        let sensor = |offer: &SensorOffer| SensorKindDescription {
            kind: offer.kind.clone(),
            summary: offer.summary.clone(),
            message: offer.message.name.to_owned(),
            parameters: offer.parameters.clone(),
        };
        let drive = |offer: &DriveOffer| DriveKindDescription {
            kind: offer.kind.clone(),
            summary: offer.summary.clone(),
            axes: offer.axes,
            parameters: offer.parameters.clone(),
        };
        DriverDescription {
            protocol: PROTOCOL,
            name: driver.name.clone(),
            summary: driver.summary.clone(),
            parameters: driver.parameters.clone(),
            sensors: driver.sensors.iter().map(sensor).collect(),
            drives: driver.drives.iter().map(drive).collect(),
        }
    }

    /// The driver that `program` described, as one that this program can compose, though not open.
    ///
    /// # Errors
    /// Another protocol, or messages of other versions than this program's, with both versions named.
    pub fn driver(self, program: &[String]) -> Result<Arc<dyn Driver>, String> {
        check_protocol(self.protocol)?;
        let sensors = self.sensors.into_iter().map(|sensor| {
            let SensorKindDescription { kind, summary, message, parameters } = sensor;
            let known = MessageType::find(&message);
            let message = *known.ok_or_else(|| format!("`{kind}`: {}", MessageType::unknown(&message)))?;
            Ok(SensorOffer { kind, summary, message, parameters })
        });
        let drives = self.drives.into_iter().map(|drive| {
            let DriveKindDescription { kind, summary, axes, parameters } = drive;
            DriveOffer { kind, summary, axes, parameters }
        });
        let info = DriverInfo {
            name: self.name,
            summary: self.summary,
            parameters: self.parameters,
            files: Vec::new(),
            sensors: sensors.collect::<Result<_, String>>()?,
            drives: drives.collect(),
        };
        Ok(Arc::new(ExternalDriver { info, program: program.to_vec() }))
    }
}

/// A driver in a program of its own.
struct ExternalDriver {
    info: DriverInfo,
    program: Vec<String>,
}

impl Driver for ExternalDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, BuildError> {
        let question = SensorQuestion {
            name: sensor.name.clone(),
            kind: sensor.kind.clone(),
            table: sensor.table.clone(),
            folder: folder.to_owned(),
        };
        let failed = |problem: String| BuildError::new("", format!("its driver cannot be asked: {problem}"));
        let text = serde_json::to_string(&question).map_err(|error| failed(error.to_string()))?;
        let carried = self.info.sensor(&sensor.kind).map_or("", |offer| offer.message.name);
        match converse(&self.program, SENSOR, &text).map_err(failed)? {
            SensorAnswer::Sensor { info, .. } if info.message != carried => {
                Err(failed(format!("it carries `{}`, not `{carried}`", info.message)))
            }
            SensorAnswer::Sensor { info, most_bytes } => {
                Ok(SensorDescription { info, max_item_bytes: most_bytes })
            }
            SensorAnswer::Refused { key, problem } => Err(BuildError { key, problem }),
        }
    }

    fn open(&self, _: DeviceSpec) -> Result<Device, BuildError> {
        Err(BuildError::new("exec", "it is a program of its own: run it with --live"))
    }
}

impl SensorAnswer {
    /// That of a driver of this program.
    pub fn of(driver: &dyn Driver, question: SensorQuestion) -> SensorAnswer {
        let SensorQuestion { name, kind, table, folder } = question;
        let answer = || -> Result<SensorDescription, BuildError> {
            let none = || BuildError::new("kind", format!("there is no sensor `{kind}`"));
            driver.info().sensor(&kind).ok_or_else(none)?;
            let sensor = PartSpec { name, kind, table };
            let described = driver.describe_sensor(&sensor, &folder)?;
            driver.check_sensor(&sensor, &folder)?;
            Ok(described)
        };
        match answer() {
            Ok(SensorDescription { info, max_item_bytes }) => {
                SensorAnswer::Sensor { info, most_bytes: max_item_bytes }
            }
            Err(BuildError { key, problem }) => SensorAnswer::Refused { key, problem },
        }
    }
}
