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
use yamabico_core::drive::Drive;
use yamabico_core::message::{Axes, Command, FrameHeader, MessageType};
use yamabico_core::sensor::{
    Device, DeviceError, DeviceSpec, DrivePlugin, DriverPlugin, PartSpec, Sensor, SensorPlugin,
};
use yamabico_core::time::Time;

/// The driver's description: driver `camera` with sensors of the kind `image-sequence`.
pub const PLUGIN: DriverPlugin = DriverPlugin {
    name: "camera",
    summary: "Cameras, and pictures from files in the place of one.",
    schema: || schema_for!(NoKeys),
    files: &[],
    sensors: &[SensorPlugin {
        kind: "image-sequence",
        summary: "PNG or JPEG files in the order of their names, as a camera would take them.",
        message: MessageType::of::<FrameHeader>(),
        schema: || schema_for!(ImageSequenceConfig),
        describe: |name, table| read::<ImageSequenceConfig>(table)?.info(name),
        most_bytes: |table| Ok(read::<ImageSequenceConfig>(table)?.bytes()),
        check: |table, folder| {
            let refused = |error: SequenceError| BuildError::new("files", error.to_string());
            files::find(&read::<ImageSequenceConfig>(table)?, folder).map_err(refused).map(drop)
        },
    }],
    drives: &[DrivePlugin {
        kind: "none",
        summary: "Takes commands and moves nothing, for pictures without a robot.",
        axes: Axes::PLANAR,
        schema: || schema_for!(NoKeys),
    }],
    open,
    told: None,
};

fn open(spec: DeviceSpec) -> Result<Device, BuildError> {
    read::<NoKeys>(&spec.table)?;
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
    let drive = spec.drive.map(|_| Box::new(NoDrive) as Box<dyn Drive>);
    Ok(Device { sensors, drive, judge: None, walls: Vec::new() })
}

/// Moves nothing.
struct NoDrive;

impl Drive for NoDrive {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn read<T: DeserializeOwned>(table: &toml::Table) -> Result<T, BuildError> {
    table.clone().try_into().map_err(|error: toml::de::Error| BuildError::new("", error.message()))
}
