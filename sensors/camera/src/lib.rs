//! Cameras: image sequences from files.

mod config;
mod files;
mod luma;
mod sequence;

pub use config::{ImageSequenceConfig, NoKeys};
pub use files::SequenceError;
pub use sequence::ImageSequence;

use schemars::schema_for;
use serde::de::DeserializeOwned;
use yamabico_core::behavior::BuildError;
use yamabico_core::message::{FrameHeader, MessageType};
use yamabico_core::sensor::{Device, DeviceSpec, DriverPlugin, PartSpec, Sensor, SensorPlugin};

/// The driver's description: driver `camera` with sensors of the kind `image-sequence`.
pub const PLUGIN: DriverPlugin = DriverPlugin {
    name: "camera",
    summary: "Cameras, and pictures from files in the place of one.",
    schema: || schema_for!(NoKeys),
    sensors: &[SensorPlugin {
        kind: "image-sequence",
        summary: "PNG or JPEG files in the order of their names, as a camera would take them.",
        message: MessageType::of::<FrameHeader>(),
        schema: || schema_for!(ImageSequenceConfig),
        describe: |name, table| read::<ImageSequenceConfig>(table)?.info(name),
        most_bytes: |table| Ok(read::<ImageSequenceConfig>(table)?.bytes()),
    }],
    drives: &[],
    open,
};

fn open(spec: DeviceSpec) -> Result<Device, BuildError> {
    read::<NoKeys>(&spec.table)?;
    if let Some(drive) = &spec.drive {
        return Err(BuildError::new("kind", format!("a camera has no drive `{}`", drive.kind)));
    }
    let open_sensor = |part: &PartSpec| -> Result<(String, Box<dyn Sensor>), BuildError> {
        if part.kind != "image-sequence" {
            return Err(BuildError::new("kind", format!("a camera has no sensor `{}`", part.kind)));
        }
        let config: ImageSequenceConfig = read(&part.table)?;
        config.info(&part.name)?;
        let sequence = ImageSequence::open(&part.name, config, &spec.folder)
            .map_err(|error| BuildError::new("files", format!("sensor `{}`: {error}", part.name)))?;
        Ok((part.name.clone(), Box::new(sequence)))
    };
    let sensors = spec.sensors.iter().map(open_sensor).collect::<Result<_, _>>()?;
    Ok(Device { sensors, drive: None, judge: None })
}

fn read<T: DeserializeOwned>(table: &toml::Table) -> Result<T, BuildError> {
    table.clone().try_into().map_err(|error: toml::de::Error| BuildError::new("", error.message()))
}
