//! Recordings as sensors. The driver `recording` publishes the measurements of a recording of this program or of ROS 2: an
//! MCAP file, or a folder of rosbag2 with MCAP or SQLite files.
//!
//! | file | contents |
//! |---|---|
//! | `config` | parameters of the device and of its sensors |
//! | `storage` | the messages of a file or folder |
//! | `topic_reader` | the measurements of one topic |
//! | `yamabico`, `ros2` | their conversion, by the encoding of the file |
//! | `playback` | the sensor that publishes them in time |
//! | `publication` | their publication, which live sensors share |

mod config;
mod measurement;
mod playback;
mod publication;
pub mod robot_file;
pub mod ros2;
pub mod storage;
mod topic_reader;
mod wheels;
mod yamabico;

pub use config::{CameraConfig, DeviceConfig, NoKeys, RangeConfig, TopicConfig, WheelsConfig};
pub use measurement::{Measurement, Refusal};
pub use playback::Playback;
pub use publication::{Filter, Publication, mount_beams};
pub use topic_reader::{RecordingError, TopicReader};
pub use wheels::Wheels;

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::ParameterError;
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{
    Axes, Beam, Bumper, Command, FrameHeader, Imu, Message, Odometry, RangeScanHeader,
};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::range_scan::MAX_BEAMS;
use yamabico_core::sensor::{DeviceError, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

/// Returns the driver `recording`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<FrameHeader, CameraConfig>("camera", "Images of a recorded camera."),
        SensorOffer::new::<RangeScanHeader, RangeConfig>(
            "range",
            "Recorded sonars or a recorded laser scanner.",
        ),
        SensorOffer::new::<Odometry, TopicConfig>("odometry", "Recorded wheel odometry."),
        SensorOffer::new::<Odometry, WheelsConfig>(
            "wheel-joints",
            "Odometry from the recorded joints of two driven wheels.",
        ),
        SensorOffer::new::<Imu, TopicConfig>("imu", "A recorded inertial measurement unit."),
        SensorOffer::new::<Bumper, TopicConfig>("bumper", "Recorded bumpers."),
    ];
    let drive =
        DriveOffer::new::<NoKeys>("none", "Ignores all commands: what was recorded is over.", Axes::PLANAR);
    Arc::new(RecordingDriver {
        info: DriverInfo {
            name: "recording".into(),
            summary: "Sensors from a recording of this program or of ROS 2.".into(),
            parameters: schema_of::<DeviceConfig>(),
            files: Vec::new(),
            sensors,
            drives: vec![drive],
        },
    })
}

struct RecordingDriver {
    info: DriverInfo,
}

impl Driver for RecordingDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let table = &sensor.table;
        let info = |message: &'static str, rate_hz: f64, latency_ms: f64, kind: SensorKind| SensorInfo {
            name: sensor.name.clone(),
            message,
            period_s: 1.0 / rate_hz,
            latency_s: 1e-3 * latency_ms,
            kind,
        };
        Ok(match sensor.kind.as_str() {
            "camera" => {
                let config: CameraConfig = read(table)?;
                let kind = SensorKind::camera(&config.intrinsics, config.mount, config.calibration)?;
                let info = info(FrameHeader::NAME, config.rate_hz, config.latency_ms, kind);
                SensorDescription { info, max_item_bytes: config.bytes() }
            }
            "range" => {
                let config: RangeConfig = read(table)?;
                let kind = SensorKind::Range { min_m: config.min_m, max_m: config.max_m };
                let info = info(RangeScanHeader::NAME, config.rate_hz, config.latency_ms, kind);
                SensorDescription { info, max_item_bytes: MAX_BEAMS * size_of::<Beam>() }
            }
            "wheel-joints" => {
                let config: WheelsConfig = read(table)?;
                let info = info(Odometry::NAME, config.rate_hz, config.latency_ms, SensorKind::Other);
                SensorDescription { info, max_item_bytes: 0 }
            }
            _ => {
                let config: TopicConfig = read(table)?;
                let info =
                    info(self.message_of(sensor), config.rate_hz, config.latency_ms, SensorKind::Other);
                SensorDescription { info, max_item_bytes: 0 }
            }
        })
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        let config: DeviceConfig = read(&spec.table)?;
        let file = spec.folder.join(&config.file);
        let sensors = spec.sensors.iter().map(|part| {
            let topic = part.table.get("topic").and_then(toml::Value::as_str).unwrap_or_default();
            let refused = |error: RecordingError| {
                ParameterError::new(error.key(), format!("sensor `{}`: {error}", part.name))
            };
            let reader = TopicReader::open(&file, topic, self.message_of(part)).map_err(refused)?;
            let playback = Playback::new(&part.name, reader, &config, part)?;
            Ok((part.name.clone(), Box::new(playback) as Box<dyn Sensor>))
        });
        Ok(Device {
            sensors: sensors.collect::<Result<_, ParameterError>>()?,
            drive: spec.drive.map(|_| Box::new(NoDrive) as Box<dyn Drive>),
            ground_truth: None,
            walls: Vec::new(),
        })
    }
}

impl RecordingDriver {
    fn message_of(&self, part: &PartSpec) -> &'static str {
        self.info.sensor(&part.kind).map_or("", |offer| offer.message.name)
    }
}

/// Drive that ignores all commands.
struct NoDrive;

impl Drive for NoDrive {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}
