//! Cameras as devices. The driver `camera` publishes image sequences from files.
//!
//! ```
//! use yamabico_camera::ImageSequenceConfig;
//!
//! let text = r#"
//!     files = "drive/*.png"
//!     intrinsics = { width = 960, height = 540, fov_deg = 75.0 }
//!     mount = { z_m = 0.3 }
//! "#;
//! let config: ImageSequenceConfig = toml::from_str(text)?;
//! assert_eq!((config.rate_hz, config.bytes()), (10.0, 960 * 540));
//! # Ok::<(), toml::de::Error>(())
//! ```

mod config;
mod file_image;
mod files;
mod sequence;
mod stamps;

pub use config::{ImageSequenceConfig, NoKeys};
pub use files::SequenceError;
pub use sequence::ImageSequence;

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::ParameterError;
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Axes, Command, FrameHeader};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::sensor::{DeviceError, Sensor};
use yamabico_core::time::Time;

/// Returns the driver `camera`, with sensors of the kind `image-sequence`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensor = SensorOffer::new::<FrameHeader, ImageSequenceConfig>(
        "image-sequence",
        "Frames from PNG or JPEG files in the order of their names.",
    );
    let drive =
        DriveOffer::new::<NoKeys>("none", "Ignores all commands, for images without a robot.", Axes::PLANAR);
    Arc::new(CameraDriver {
        info: DriverInfo {
            name: "camera".into(),
            summary: "Cameras, and image files instead of a camera.".into(),
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

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let config: ImageSequenceConfig = read(&sensor.table)?;
        Ok(SensorDescription { info: config.info(&sensor.name)?, max_item_bytes: config.bytes() })
    }

    fn check_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<(), ParameterError> {
        let refused = |error: SequenceError| ParameterError::new("files", error.to_string());
        let config: ImageSequenceConfig = read(&sensor.table)?;
        let files = files::find(&config, folder).map_err(refused)?;
        let refused = |error: SequenceError| ParameterError::new("stamps", error.to_string());
        stamps::read(&config.stamps, &files, folder).map_err(refused).map(drop)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        read::<NoKeys>(&spec.table)?;
        let open_sensor = |part: &PartSpec| -> Result<(String, Box<dyn Sensor>), ParameterError> {
            if part.kind != "image-sequence" {
                return Err(ParameterError::new(
                    "kind",
                    format!("must be `image-sequence`, but is `{}`", part.kind),
                ));
            }
            let config: ImageSequenceConfig = read(&part.table)?;
            config.info(&part.name)?;
            let sequence = ImageSequence::open(&part.name, config, &spec.folder)
                .map_err(|error| ParameterError::new("files", format!("sensor `{}`: {error}", part.name)))?;
            Ok((part.name.clone(), Box::new(sequence)))
        };
        let sensors = spec.sensors.iter().map(open_sensor).collect::<Result<_, _>>()?;
        let drive = spec.drive.map(|_| Box::new(NoDrive) as Box<dyn Drive>);
        Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
    }
}

/// Drive that ignores all commands.
struct NoDrive;

impl Drive for NoDrive {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}
