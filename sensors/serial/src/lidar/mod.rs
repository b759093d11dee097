//! Lidars LD06, LD19 and LD08 (the LDS-02 of a TurtleBot3), which only talk.

mod packet;
mod revolution;

pub use packet::{POINTS, Packet};
pub use revolution::{Mounting, Revolution, Scan};

use std::path::PathBuf;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{Device, DeviceSpec, Driver, PartSpec, SensorDescription, SensorOffer};
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::parameters::read;
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;

use crate::framing::Framer;
use crate::line::{Conversation, Line, LineConfig};
use crate::parts::{LineSensor, Outbox, SerialDriver, description, no_sensor};

/// Name of the driver in robot files.
const NAME: &str = "ld06";
/// Time of a revolution, s: the lidar turns ten times a second by itself.
const PERIOD_S: f64 = 0.1;
/// Time from the middle of a revolution to its arrival, s.
const LATENCY_S: f64 = 0.055;

/// Parameters of the lidar's line.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LidarConfig {
    /// Serial port.
    #[schemars(extend("format" = "path"))]
    pub port: PathBuf,
    /// Bits per second: 230400 for LD06 and LD19, 115200 for LD08 (LDS-02).
    #[serde_inline_default(230_400)]
    #[schemars(range(min = 9600, max = 921_600))]
    pub baud: u32,
}

/// Parameters of its scans.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanConfig {
    /// Position forward of the robot's center.
    #[serde(default)]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub x_m: f64,
    /// Position left of the robot's center.
    #[serde(default)]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Direction of the lidar's zero angle, the arrow on its housing; positive to the left of ahead.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    pub yaw_deg: f64,
    /// Minimum range; nearer echoes are the housing or dust.
    #[serde_inline_default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Maximum range.
    #[serde_inline_default(8.0)]
    #[schemars(range(min = 0.5, max = 25.0))]
    pub max_m: f64,
    /// Number of beams of a scan; each takes the shortest range of its points. The lidar measures about 450 points per turn.
    #[serde_inline_default(240)]
    #[schemars(range(min = 8, max = 300))]
    pub beams: usize,
}

/// Returns the driver `ld06`, with sensors of the kind `lidar`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensor = SensorOffer::new::<RangeScanHeader, ScanConfig>(
        "lidar",
        "One range scan per turn; turns that lack a packet are dropped.",
    );
    let summary = "Lidar LD06, LD19 or LD08 (LDS-02) on a serial port.";
    SerialDriver::arc::<LidarConfig>(NAME, summary, vec![sensor], Vec::new(), describe, open)
}

fn describe(sensor: &PartSpec) -> Result<SensorDescription, ParameterError> {
    if sensor.kind != "lidar" {
        return Err(no_sensor(&sensor.kind));
    }
    let config: ScanConfig = read(&sensor.table)?;
    let range = SensorKind::Range { min_m: config.min_m, max_m: config.max_m };
    if config.max_m <= config.min_m {
        return Err(ParameterError::new("max_m", "must be above min_m"));
    }
    Ok(description::<RangeScanHeader>(&sensor.name, PERIOD_S, LATENCY_S, range, config.beams))
}

fn open(spec: &DeviceSpec) -> Result<Device, ParameterError> {
    let config: LidarConfig = read(&spec.table)?;
    let Some(part) = spec.sensors.first() else {
        return Err(ParameterError::new(
            "driver",
            "a lidar without a sensor: add `[sensors.NAME]` of the kind `lidar`",
        ));
    };
    let scan: ScanConfig = read(&part.table)?;
    let mounting = Mounting {
        position_m: [scan.x_m, scan.y_m],
        yaw_rad: scan.yaw_deg.to_radians(),
        range_m: [scan.min_m, scan.max_m],
        beams: scan.beams,
    };
    let conversation =
        Lidar { framer: Framer::default(), revolution: Revolution::new(mounting), scans: Outbox::default() };
    let line = LineConfig { device: spec.name.clone(), port: config.port, baud: config.baud };
    let line = Line::open(line, conversation);
    let line = Arc::new(line.map_err(|error| ParameterError::new("port", error.to_string()))?);
    let sensors = vec![LineSensor::<_, RangeScanHeader>::boxed(&part.name, &line, |lidar| lidar.scans.pop())];
    Ok(Device { sensors, drive: None, ground_truth: None, walls: Vec::new() })
}

/// Conversation with a lidar, which only listens.
struct Lidar {
    framer: Framer<Packet>,
    revolution: Revolution,
    scans: Outbox<(RangeScanHeader, Vec<Beam>)>,
}

impl Conversation for Lidar {
    fn begin(&mut self, _: Time) {
        self.framer.clear();
    }

    fn receive(&mut self, bytes: &[u8], arrival: Time) {
        let Lidar { framer, revolution, scans } = self;
        framer.push(bytes, |packet| {
            if let Some(scan) = revolution.push(&packet, arrival) {
                scans.push(scan);
            }
        });
    }

    fn turn(&mut self, _: Time, _: &mut Vec<u8>) {}

    fn frames(&self) -> (u64, u64) {
        (self.framer.frames(), self.framer.skipped())
    }
}
