//! Cameras as devices. The driver `camera` publishes motion JPEG from HTTP and from programs, and image sequences from files.
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
//! assert_eq!((config.rate_hz, config.description().bytes()), (10.0, 960 * 540));
//! # Ok::<(), toml::de::Error>(())
//! ```

mod config;
mod description;
mod file_image;
mod files;
mod grabber;
mod http;
pub mod jpeg;
pub mod jpeg_cutter;
mod jpeg_stream;
mod live_camera;
mod live_config;
mod pixels;
mod program;
mod sequence;
mod stamps;
#[cfg(feature = "v4l2")]
mod v4l2;

pub use config::{ImageSequenceConfig, NoKeys};
pub use description::CameraDescription;
pub use files::SequenceError;
pub use http::HttpCameraConfig;
pub use program::ProgramCameraConfig;
pub use sequence::ImageSequence;
#[cfg(feature = "v4l2")]
pub use v4l2::V4l2CameraConfig;

use grabber::{Grabber, Source};
use http::HttpSource;
use live_camera::LiveCamera;
use program::ProgramSource;

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

/// Returns the driver `camera`, with sensors of the kinds `http`, `program` and `image-sequence`, and with the feature of that name
/// `v4l2`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<FrameHeader, HttpCameraConfig>(
            "http",
            "Motion JPEG over HTTP, of network cameras and phones; the connection is opened again when it is lost.",
        ),
        SensorOffer::new::<FrameHeader, ImageSequenceConfig>(
            "image-sequence",
            "Frames from PNG or JPEG files in the order of their names.",
        ),
        SensorOffer::new::<FrameHeader, ProgramCameraConfig>(
            "program",
            "Motion JPEG from the output of a program, such as rpicam-vid, ffmpeg or GStreamer.",
        ),
        #[cfg(feature = "v4l2")]
        SensorOffer::new::<FrameHeader, V4l2CameraConfig>(
            "v4l2",
            "USB and other cameras of the kernel; the format is chosen by size and rate, and the kernel stamps the frames.",
        ),
    ];
    let drive =
        DriveOffer::new::<NoKeys>("none", "Ignores all commands, for images without a robot.", Axes::PLANAR);
    Arc::new(CameraDriver {
        info: DriverInfo {
            name: "camera".into(),
            summary: "Cameras, and image files instead of a camera.".into(),
            parameters: schema_of::<NoKeys>(),
            files: Vec::new(),
            sensors,
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
        let view = match sensor.kind.as_str() {
            "http" => {
                let config: HttpCameraConfig = read(&sensor.table)?;
                HttpSource::new(&config)?;
                config.description()
            }
            "program" => {
                let config: ProgramCameraConfig = read(&sensor.table)?;
                ProgramSource::new(&config)?;
                config.description()
            }
            #[cfg(feature = "v4l2")]
            "v4l2" => read::<V4l2CameraConfig>(&sensor.table)?.description(),
            _ => read::<ImageSequenceConfig>(&sensor.table)?.description(),
        };
        Ok(SensorDescription { info: view.info(&sensor.name)?, max_item_bytes: view.bytes() })
    }

    fn check_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<(), ParameterError> {
        let refused = |error: SequenceError| ParameterError::new("files", error.to_string());
        if sensor.kind != "image-sequence" {
            return Ok(());
        }
        let config: ImageSequenceConfig = read(&sensor.table)?;
        let files = files::find(&config, folder).map_err(refused)?;
        let refused = |error: SequenceError| ParameterError::new("stamps", error.to_string());
        stamps::read(&config.stamps, &files, folder).map_err(refused).map(drop)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        read::<NoKeys>(&spec.table)?;
        let open_sensor = |part: &PartSpec| -> Result<(String, Box<dyn Sensor>), ParameterError> {
            let sensor: Box<dyn Sensor> = match part.kind.as_str() {
                "http" => {
                    let config: HttpCameraConfig = read(&part.table)?;
                    Box::new(live(part, config.description(), HttpSource::new(&config)?)?)
                }
                "program" => {
                    let config: ProgramCameraConfig = read(&part.table)?;
                    Box::new(live(part, config.description(), ProgramSource::new(&config)?)?)
                }
                #[cfg(feature = "v4l2")]
                "v4l2" => {
                    let config: V4l2CameraConfig = read(&part.table)?;
                    Box::new(live(part, config.description(), v4l2::V4l2Source::new(&config))?)
                }
                "image-sequence" => {
                    let config: ImageSequenceConfig = read(&part.table)?;
                    config.description().info(&part.name)?;
                    let sequence = ImageSequence::open(&part.name, config, &spec.folder);
                    let refused = |error| format!("sensor `{}`: {error}", part.name);
                    Box::new(sequence.map_err(|error| ParameterError::new("files", refused(error)))?)
                }
                other => {
                    return Err(ParameterError::new("kind", format!("the driver has no sensor `{other}`")));
                }
            };
            Ok((part.name.clone(), sensor))
        };
        let sensors = spec.sensors.iter().map(open_sensor).collect::<Result<_, _>>()?;
        let drive = spec.drive.map(|_| Box::new(NoDrive) as Box<dyn Drive>);
        Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
    }
}

/// Opens a camera that sends by itself. One that is not there yet is waited for.
fn live(part: &PartSpec, view: CameraDescription, source: impl Source) -> Result<LiveCamera, ParameterError> {
    view.info(&part.name)?;
    let grabber = Grabber::start(&part.name, source);
    let grabber = grabber.map_err(|error| ParameterError::new("kind", error.to_string()))?;
    Ok(LiveCamera::new(&part.name, view, grabber))
}

/// Drive that ignores all commands.
struct NoDrive;

impl Drive for NoDrive {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}
