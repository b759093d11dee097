//! Description of a driver in an external program, printed before it is launched.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::behavior_description::{check_protocol, declares, message_type};
use super::launch::PROTOCOL;
use super::query::query;
use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Axes, MessageDeclaration};
use yamabico_core::sensor::SensorInfo;

/// Argument that makes a program answer a [`SensorQuestion`] on standard input with a [`SensorAnswer`], both JSON.
pub const SENSOR: &str = "--sensor";

/// Description of a driver, printed as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriverDescription {
    /// Version of the protocol, [`PROTOCOL`].
    pub protocol: u32,
    /// Name of the driver, kebab-case.
    pub name: String,
    /// One sentence on the devices that it drives.
    pub summary: String,
    /// JSON Schema of the device's own keys.
    pub parameters: Json,
    /// Kinds of sensors that it offers.
    pub sensors: Vec<SensorKindDescription>,
    /// Kinds of drives that it offers.
    pub drives: Vec<DriveKindDescription>,
}

/// Description of a kind of sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorKindDescription {
    /// Name of the kind in robot files.
    pub kind: String,
    /// One sentence on its measurements.
    pub summary: String,
    /// Versioned name of its message type, such as `yamabico.Odometry.v1`.
    pub message: String,
    /// Layout of a message type of the program's own; none for one of Yamabico.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declares: Option<MessageDeclaration>,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// Description of a kind of drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveKindDescription {
    /// Name of the kind in robot files.
    pub kind: String,
    /// One sentence on its motion.
    pub summary: String,
    /// Axes of motion, such as `linear+angular`.
    pub axes: Axes,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// Question about a sensor whose table is valid under its schema.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorQuestion {
    /// Name of the sensor in the robot file.
    pub name: String,
    /// Kind of sensor, one that the program offers.
    pub kind: String,
    /// Its own keys, without defaults.
    pub table: toml::Table,
    /// Folder that relative paths in the table refer to.
    pub folder: PathBuf,
}

/// Answer to a [`SensorQuestion`], printed as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensorAnswer {
    /// The sensor is valid.
    Sensor {
        /// Description for behaviors.
        info: SensorInfo,
        /// Longest list of items in one of its messages, bytes.
        #[serde(alias = "most_bytes")]
        max_item_bytes: usize,
    },
    /// The sensor is invalid.
    Refused {
        /// Key to change, dotted; empty if no key is the cause.
        key: String,
        /// Problem with the key.
        problem: String,
        /// Remedy.
        #[serde(default)]
        remedy: Option<String>,
    },
}

impl DriverDescription {
    /// Describes a driver of this program.
    pub fn of(driver: &DriverInfo) -> DriverDescription {
        let sensor = |offer: &SensorOffer| SensorKindDescription {
            kind: offer.kind.clone(),
            summary: offer.summary.clone(),
            message: offer.message.name.to_owned(),
            declares: declares(&offer.message),
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

    /// Makes a driver with which a robot file can be checked; it queries `program` about sensors and cannot open a
    /// device.
    ///
    /// # Errors
    /// The protocol or a message type has another version; the error names both versions.
    pub fn driver(self, program: &[String]) -> Result<Arc<dyn Driver>, String> {
        check_protocol(self.protocol)?;
        let sensors = self.sensors.into_iter().map(|sensor| {
            let SensorKindDescription { kind, summary, message, declares, parameters } = sensor;
            let message = message_type(&message, declares.as_ref())
                .map_err(|problem| format!("`{kind}`: {problem}"))?;
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

/// Driver in an external program.
struct ExternalDriver {
    info: DriverInfo,
    program: Vec<String>,
}

impl Driver for ExternalDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, ParameterError> {
        let question = SensorQuestion {
            name: sensor.name.clone(),
            kind: sensor.kind.clone(),
            table: sensor.table.clone(),
            folder: folder.to_owned(),
        };
        let failed =
            |problem: String| ParameterError::new("", format!("querying its driver failed: {problem}"));
        let text = serde_json::to_string(&question).map_err(|error| failed(error.to_string()))?;
        let carried = self.info.sensor(&sensor.kind).map_or("", |offer| offer.message.name);
        match query(&self.program, SENSOR, &text).map_err(failed)? {
            SensorAnswer::Sensor { info, .. } if info.message != carried => Err(failed(format!(
                "the sensor publishes `{}`, but its kind publishes `{carried}`",
                info.message
            ))),
            SensorAnswer::Sensor { info, max_item_bytes } => Ok(SensorDescription { info, max_item_bytes }),
            SensorAnswer::Refused { key, problem, remedy } => Err(ParameterError { key, problem, remedy }),
        }
    }

    fn open(&self, _: DeviceSpec) -> Result<Device, ParameterError> {
        Err(ParameterError::new("exec", "an external program runs only in a live run: add --live"))
    }
}

impl SensorAnswer {
    /// Answers a question about a sensor of `driver`.
    pub fn of(driver: &dyn Driver, question: SensorQuestion) -> SensorAnswer {
        let SensorQuestion { name, kind, table, folder } = question;
        let answer = || -> Result<SensorDescription, ParameterError> {
            let none = || ParameterError::new("kind", format!("unknown kind of sensor `{kind}`"));
            driver.info().sensor(&kind).ok_or_else(none)?;
            let sensor = PartSpec { name, kind, table };
            let described = driver.describe_sensor(&sensor, &folder)?;
            driver.check_sensor(&sensor, &folder)?;
            Ok(described)
        };
        match answer() {
            Ok(SensorDescription { info, max_item_bytes }) => SensorAnswer::Sensor { info, max_item_bytes },
            Err(ParameterError { key, problem, remedy }) => SensorAnswer::Refused { key, problem, remedy },
        }
    }
}
