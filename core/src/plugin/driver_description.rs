//! What a program tells of the driver that it is, before it runs.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::charge::PROTOCOL;
use crate::behavior::BuildError;
use crate::message::{Axes, MessageType};
use crate::sensor::{DrivePlugin, DriverPlugin, SensorInfo, SensorPlugin};

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
    pub sensors: Vec<SensorDescription>,
    /// The kinds of drive that it offers.
    pub drives: Vec<DriveDescription>,
}

/// A kind of sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorDescription {
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
pub struct DriveDescription {
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
        /// What behaviours are told about it.
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

/// What another program told of the driver that it is.
#[derive(Debug)]
pub struct ToldDriver {
    /// The program and its arguments.
    pub program: Vec<String>,
    /// What it told.
    pub description: DriverDescription,
}

impl DriverDescription {
    /// That of a driver of this program.
    pub fn of(driver: &DriverPlugin) -> DriverDescription {
        let sensor = |plugin: &SensorPlugin| SensorDescription {
            kind: plugin.kind.to_owned(),
            summary: plugin.summary.to_owned(),
            message: plugin.message.name.to_owned(),
            parameters: (plugin.schema)().to_value(),
        };
        let drive = |plugin: &DrivePlugin| DriveDescription {
            kind: plugin.kind.to_owned(),
            summary: plugin.summary.to_owned(),
            axes: plugin.axes,
            parameters: (plugin.schema)().to_value(),
        };
        DriverDescription {
            protocol: PROTOCOL,
            name: driver.name.to_owned(),
            summary: driver.summary.to_owned(),
            parameters: driver.parameters(),
            sensors: driver.sensors.iter().map(sensor).collect(),
            drives: driver.drives.iter().map(drive).collect(),
        }
    }

    /// The driver that `program` described, as one that this program can compose, though not open. What it says is kept until
    /// this program ends.
    ///
    /// # Errors
    /// Another protocol, or messages of other versions than this program's, with both versions named.
    pub fn plugin(self, program: &[String]) -> Result<DriverPlugin, String> {
        if self.protocol != PROTOCOL {
            let told = self.protocol;
            return Err(format!("it speaks version {told} of the protocol, this program version {PROTOCOL}"));
        }
        let told: &'static ToldDriver =
            Box::leak(Box::new(ToldDriver { program: program.to_vec(), description: self }));
        let description = &told.description;
        let sensors = description.sensors.iter().map(|sensor| {
            let message = MessageType::find(&sensor.message);
            let message = *message
                .ok_or_else(|| format!("`{}`: {}", sensor.kind, MessageType::unknown(&sensor.message)))?;
            Ok(SensorPlugin {
                kind: &sensor.kind,
                summary: &sensor.summary,
                message,
                schema: schemars::Schema::default,
                describe: |_, _| Err(elsewhere()),
                most_bytes: |_| Err(elsewhere()),
                check: |_, _| Ok(()),
            })
        });
        let drives = description.drives.iter().map(|drive| DrivePlugin {
            kind: &drive.kind,
            summary: &drive.summary,
            axes: drive.axes,
            schema: schemars::Schema::default,
        });
        Ok(DriverPlugin {
            name: &description.name,
            summary: &description.summary,
            schema: schemars::Schema::default,
            files: &[],
            sensors: Box::leak(sensors.collect::<Result<Box<[_]>, String>>()?),
            drives: Box::leak(drives.collect::<Box<[_]>>()),
            open: |_| Err(elsewhere()),
            told: Some(told),
        })
    }
}

impl SensorAnswer {
    /// That of a driver of this program.
    pub fn of(driver: &DriverPlugin, question: &SensorQuestion) -> SensorAnswer {
        let answer = || -> Result<SensorAnswer, BuildError> {
            let none = || BuildError::new("kind", format!("there is no sensor `{}`", question.kind));
            let plugin = driver.sensor(&question.kind).ok_or_else(none)?;
            let info = (plugin.describe)(&question.name, &question.table)?;
            let most_bytes = (plugin.most_bytes)(&question.table)?;
            (plugin.check)(&question.table, &question.folder)?;
            Ok(SensorAnswer::Sensor { info, most_bytes })
        };
        answer().unwrap_or_else(|BuildError { key, problem }| SensorAnswer::Refused { key, problem })
    }
}

impl DriverPlugin {
    /// JSON Schema of the device's own table.
    pub fn parameters(&self) -> Json {
        self.told.map_or_else(|| (self.schema)().to_value(), |told| told.description.parameters.clone())
    }

    /// JSON Schema of the parameters of a kind of sensor.
    pub fn parameters_of_sensor(&self, plugin: &SensorPlugin) -> Json {
        let told = self
            .told
            .and_then(|told| told.description.sensors.iter().find(|sensor| sensor.kind == plugin.kind));
        told.map_or_else(|| (plugin.schema)().to_value(), |sensor| sensor.parameters.clone())
    }

    /// JSON Schema of the parameters of a kind of drive.
    pub fn parameters_of_drive(&self, plugin: &DrivePlugin) -> Json {
        let told =
            self.told.and_then(|told| told.description.drives.iter().find(|drive| drive.kind == plugin.kind));
        told.map_or_else(|| (plugin.schema)().to_value(), |drive| drive.parameters.clone())
    }
}

fn elsewhere() -> BuildError {
    BuildError::new("exec", "it is a program of its own: run it with --live")
}
