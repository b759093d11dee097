//! TurtleBot3 without ROS: its OpenCR board is a Dynamixel device with the number 200.
//!
//! The control table is the one that ROBOTIS' node `turtlebot3_node` uses. The board stops the wheels when the heartbeat stops,
//! but has no age of commands: this driver beats only while commands are fresh, so that the board watches the commands, too.

mod conversation;
mod packet;
mod table;

pub use packet::{Packet, STATUS, WRITE};
pub use table::{BLOCK, BLOCK_LEN, HEARTBEAT, ID, VELOCITY};

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
use yamabico_core::message::{Axes, Bumper, Imu, Odometry};
use yamabico_core::parameters::read;
use yamabico_core::sensor::SensorKind;

use crate::commanded::Commanded;
use crate::dead_reckoning::WheelGeometry;
use crate::line::{Line, LineConfig};
use crate::parts::{LineDrive, LineSensor, SerialDriver, description, no_sensor};
use conversation::TurtleBot3;

/// Name of the driver in robot files.
const NAME: &str = "turtlebot3";
/// Bits per second; USB ignores it.
const BAUD: u32 = 1_000_000;
/// Radius of a wheel, m, and counts per revolution of its Dynamixel XL430.
const WHEEL_RADIUS_M: f64 = 0.033;
const COUNTS_PER_REVOLUTION: f64 = 4096.0;
/// Period without sensors, ms: the answers tell that the board is there.
const MAX_PERIOD_MS: f64 = 200.0;
/// Delay from the middle of a request and its answer to the answer, s.
const LATENCY_S: f64 = 0.005;

/// Parameters of a TurtleBot3.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurtleBot3Config {
    /// Serial port of the OpenCR board, `/dev/ttyACM0` or its name in `/dev/serial/by-id`.
    #[schemars(extend("format" = "path"))]
    pub port: PathBuf,
    /// Distance between the wheels: 0.16 for a Burger, 0.287 for a Waffle.
    #[serde_inline_default(0.16)]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub track_m: f64,
}

/// Parameters of a sensor of a TurtleBot3.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurtleBot3SensorConfig {
    /// Period of the measurements: the shortest one of the device's sensors holds for all. ROBOTIS' node has 50.
    #[serde_inline_default(50.0)]
    #[schemars(range(min = 10.0, max = 200.0))]
    pub period_ms: f64,
}

/// Parameters of its drive.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurtleBot3DriveConfig {
    /// Time without a command after which the driver stops the robot and its heartbeat.
    #[serde_inline_default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
    /// Maximum speed of a wheel: 0.22 for a Burger, 0.26 for a Waffle.
    #[serde_inline_default(0.22)]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub max_wheel_mps: f64,
}

/// Returns the driver `turtlebot3`, with sensors of the kinds `encoders`, `imu` and `bumpers`, and a drive.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<Odometry, TurtleBot3SensorConfig>(
            "encoders",
            "Wheel odometry from the wheels' positions.",
        ),
        SensorOffer::new::<Imu, TurtleBot3SensorConfig>(
            "imu",
            "Gyroscope, accelerometer and attitude of the board.",
        ),
        SensorOffer::new::<Bumper, TurtleBot3SensorConfig>(
            "bumpers",
            "Two bumpers, if some are connected to the board.",
        ),
    ];
    let drive = DriveOffer::new::<TurtleBot3DriveConfig>(
        "differential",
        "Two driven wheels: forward and turn. Stops by itself when commands stop, and so does the board.",
        Axes::PLANAR,
    );
    let summary = "TurtleBot3 on its OpenCR board, without ROS.";
    SerialDriver::arc::<TurtleBot3Config>(NAME, summary, sensors, vec![drive], describe, open)
}

fn describe(sensor: &PartSpec) -> Result<SensorDescription, ParameterError> {
    let config: TurtleBot3SensorConfig = read(&sensor.table)?;
    let (name, period_s) = (&sensor.name, 1e-3 * config.period_ms);
    Ok(match sensor.kind.as_str() {
        "encoders" => description::<Odometry>(name, period_s, LATENCY_S, SensorKind::Other, 0),
        "imu" => description::<Imu>(name, period_s, LATENCY_S, SensorKind::Other, 0),
        "bumpers" => description::<Bumper>(name, period_s, LATENCY_S, SensorKind::Other, 0),
        other => return Err(no_sensor(other)),
    })
}

fn open(spec: &DeviceSpec) -> Result<Device, ParameterError> {
    let config: TurtleBot3Config = read(&spec.table)?;
    let table = spec.drive.as_ref().map(|drive| drive.table.clone()).unwrap_or_default();
    let drive: TurtleBot3DriveConfig = read(&table)?;
    let commanded = Commanded::new(Duration::from_secs_f64(1e-3 * drive.watchdog_ms));
    let wheels = WheelGeometry {
        m_per_count: 2.0 * std::f64::consts::PI * WHEEL_RADIUS_M / COUNTS_PER_REVOLUTION,
        track_m: config.track_m,
        max_mps: drive.max_wheel_mps,
    };
    let periods = spec.sensors.iter().map(|part| Ok(read::<TurtleBot3SensorConfig>(&part.table)?.period_ms));
    let periods = periods.collect::<Result<Vec<f64>, ParameterError>>()?;
    let period_ms = periods.into_iter().fold(f64::INFINITY, f64::min).min(MAX_PERIOD_MS);
    let conversation = TurtleBot3::new(wheels, Duration::from_secs_f64(1e-3 * period_ms), commanded);
    let line = LineConfig { device: spec.name.clone(), port: config.port, baud: BAUD };
    let line = Line::open(line, conversation);
    let line = Arc::new(line.map_err(|error| ParameterError::new("port", error.to_string()))?);
    let sensor = |part: &PartSpec| match part.kind.as_str() {
        "encoders" => Ok(LineSensor::<_, Odometry>::boxed(&part.name, &line, |robot| robot.odometry.pop())),
        "imu" => Ok(LineSensor::<_, Imu>::boxed(&part.name, &line, |robot| robot.imu.pop())),
        "bumpers" => Ok(LineSensor::<_, Bumper>::boxed(&part.name, &line, |robot| robot.bumpers.pop())),
        other => Err(no_sensor(other)),
    };
    let sensors = spec.sensors.iter().map(sensor).collect::<Result<_, _>>()?;
    let drive = spec.drive.as_ref().map(|_| Box::new(LineDrive(Arc::clone(&line))) as _);
    Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
}
