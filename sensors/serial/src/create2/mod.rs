//! iRobot Create 2, and Roombas of the series 500 to 800, on their serial port.
//!
//! Facts are from the iRobot Create 2 Open Interface Specification. The robot has no watchdog on its drive commands: this
//! driver's own stops it when commands stop. A driver that was killed stops it as it starts again.

mod conversation;
mod proximity;
mod stream;

pub use stream::Readings;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Axes, Bumper, Odometry, RangeScanHeader};
use yamabico_core::parameters::read;
use yamabico_core::sensor::SensorKind;

use crate::commanded::Commanded;
use crate::line::{Line, LineConfig};
use crate::parts::{LineDrive, LineSensor, NoKeys, SerialDriver, description, no_sensor};
use conversation::{Create2, STREAM_PERIOD};

/// Name of the driver in robot files.
const NAME: &str = "create2";
/// Time that a USB adapter may hold measurements back, s.
const LATENCY_S: f64 = 0.016;

/// Parameters of a Create 2.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Create2Config {
    /// Serial port; the names in `/dev/serial/by-id` stay the same when devices are connected in another order.
    #[schemars(extend("format" = "path"))]
    pub port: PathBuf,
    /// Bits per second: 115200, or 19200 if its BRC line selected that rate.
    #[serde_inline_default(115_200)]
    #[schemars(range(min = 19200, max = 115_200))]
    pub baud: u32,
    /// Distance between the wheels. The specification says 0.235; turning ten times on the spot measures it.
    #[serde_inline_default(0.235)]
    #[schemars(range(min = 0.1, max = 0.5))]
    pub track_m: f64,
}

/// Parameters of its drive.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Create2DriveConfig {
    /// Time without a command after which the driver stops the robot.
    #[serde_inline_default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
    /// Maximum speed of a wheel. The specification says 0.5, robots with worn batteries reach a third of a meter per second.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.05, max = 0.5))]
    pub max_wheel_mps: f64,
}

/// Returns the driver `create2`, with sensors of the kinds `encoders`, `bumpers` and `proximity`, and a drive.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<Odometry, NoKeys>(
            "encoders",
            "Wheel odometry from the encoder counts, every 15 ms.",
        ),
        SensorOffer::new::<Bumper, NoKeys>(
            "bumpers",
            "Bits from the lowest: left and right bumper, left and right wheel dropped, four cliffs from the left, virtual wall.",
        ),
        SensorOffer::new::<RangeScanHeader, NoKeys>(
            "proximity",
            "Bumpers, cliffs, dropped wheels, wall and light bumper as a range scan of 0.1 m, for sonar-halt.",
        ),
    ];
    let drive = DriveOffer::new::<Create2DriveConfig>(
        "differential",
        "Two driven wheels: forward and turn. Stops by itself when commands stop.",
        Axes::PLANAR,
    );
    let summary = "iRobot Create 2 or Roomba on its serial port (Open Interface).";
    SerialDriver::arc::<Create2Config>(NAME, summary, sensors, vec![drive], describe, open)
}

fn describe(sensor: &PartSpec) -> Result<SensorDescription, ParameterError> {
    let (name, period_s) = (&sensor.name, STREAM_PERIOD.as_secs_f64());
    let range = SensorKind::Range { min_m: 0.0, max_m: proximity::MAX_M };
    Ok(match sensor.kind.as_str() {
        "encoders" => description::<Odometry>(name, period_s, LATENCY_S, SensorKind::Other, 0),
        "bumpers" => description::<Bumper>(name, period_s, LATENCY_S, SensorKind::Other, 0),
        "proximity" => description::<RangeScanHeader>(name, period_s, LATENCY_S, range, proximity::BEAMS),
        other => return Err(no_sensor(other)),
    })
}

fn open(spec: &DeviceSpec) -> Result<Device, ParameterError> {
    let config: Create2Config = read(&spec.table)?;
    let table = spec.drive.as_ref().map(|drive| drive.table.clone()).unwrap_or_default();
    let drive: Create2DriveConfig = read(&table)?;
    let commanded = Commanded::new(Duration::from_secs_f64(1e-3 * drive.watchdog_ms));
    let conversation = Create2::new(config.track_m, drive.max_wheel_mps, commanded);
    let line = LineConfig { device: spec.name.clone(), port: config.port, baud: config.baud };
    let line = Line::open(line, conversation);
    let line = Arc::new(line.map_err(|error| ParameterError::new("port", error.to_string()))?);
    let sensor = |part: &PartSpec| match part.kind.as_str() {
        "encoders" => Ok(LineSensor::<_, Odometry>::boxed(&part.name, &line, |robot| robot.odometry.pop())),
        "bumpers" => Ok(LineSensor::<_, Bumper>::boxed(&part.name, &line, |robot| robot.bumpers.pop())),
        "proximity" => {
            Ok(LineSensor::<_, RangeScanHeader>::boxed(&part.name, &line, |robot| robot.scans.pop()))
        }
        other => Err(no_sensor(other)),
    };
    let sensors = spec.sensors.iter().map(sensor).collect::<Result<_, _>>()?;
    let drive = spec.drive.as_ref().map(|_| Box::new(LineDrive(Arc::clone(&line))) as _);
    Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
}
