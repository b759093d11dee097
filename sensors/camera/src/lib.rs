//! Cameras: image sequences from files.

mod config;
mod files;
mod luma;
mod sequence;

pub use config::{ImageSequenceConfig, NoKeys};
pub use files::SequenceError;
pub use sequence::ImageSequence;

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::BuildError;
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Axes, Command, FrameHeader};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::sensor::{DeviceError, Sensor};
use yamabico_core::time::Time;

/// The driver `camera`, with sensors of the kind `image-sequence`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensor = SensorOffer::new::<FrameHeader, ImageSequenceConfig>(
        "image-sequence",
        "PNG or JPEG files in the order of their names, as a camera would take them.",
    );
    let drive = DriveOffer::new::<NoKeys>(
        "none",
        "Takes commands and moves nothing, for pictures without a robot.",
        Axes::PLANAR,
    );
    Arc::new(CameraDriver {
        info: DriverInfo {
            name: "camera".into(),
            summary: "Cameras, and pictures from files in the place of one.".into(),
            parameters: schema_of::<NoKeys>(),
            files: Vec::new(),
            sensors: vec![sensor],
            drives: vec![drive],
        },
    })
}

struct CameraDriver {
    info: DriverInfo,
}

impl Driver for CameraDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, BuildError> {
        let config: ImageSequenceConfig = read(&sensor.table)?;
        Ok(SensorDescription { info: config.info(&sensor.name)?, max_item_bytes: config.bytes() })
    }

    fn check_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<(), BuildError> {
        let refused = |error: SequenceError| BuildError::new("files", error.to_string());
        files::find(&read(&sensor.table)?, folder).map_err(refused).map(drop)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, BuildError> {
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
}

/// Moves nothing.
struct NoDrive;

impl Drive for NoDrive {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}
