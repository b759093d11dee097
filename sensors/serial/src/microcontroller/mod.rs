//! Robots of one's own: a microcontroller with two wheels, encoders, bumpers and sonars that speaks the line protocol of
//! `docs/line-protocol.md`. Reference firmware in C is in `firmware/`.

mod conversation;
mod message;

pub use message::{
    Line as ProtocolLine, MAX_SONARS, MOTORS_OFF, Measurement, STOPPED_BY_WATCHDOG, Sonar, VERSION, checksum,
};

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
use yamabico_core::sonar_ring::RingGeometry;

use crate::commanded::Commanded;
use crate::dead_reckoning::WheelGeometry;
use crate::line::{Line, LineConfig};
use crate::parts::{LineDrive, LineSensor, SerialDriver, description, no_sensor};
use conversation::{Microcontroller, SonarRing};

/// Name of the driver in robot files.
const NAME: &str = "microcontroller";
/// Time that a USB adapter may hold a line back, s.
const LATENCY_S: f64 = 0.016;

/// Parameters of the robot.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicrocontrollerConfig {
    /// Serial port; the names in `/dev/serial/by-id` stay the same when devices are connected in another order.
    #[schemars(extend("format" = "path"))]
    pub port: PathBuf,
    /// Bits per second; USB boards ignore it.
    #[serde_inline_default(115_200)]
    #[schemars(range(min = 9600, max = 1_000_000))]
    pub baud: u32,
    /// Counts of an encoder per meter of its wheel's travel: counts per revolution divided by the circumference.
    #[schemars(range(min = 10.0, max = 1e7), extend("examples" = [5000.0]))]
    pub counts_per_m: f64,
    /// Distance between the wheels.
    #[schemars(range(min = 0.02, max = 2.0), extend("examples" = [0.16]))]
    pub track_m: f64,
}

/// Parameters of its encoders and bumpers.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasurementConfig {
    /// Time between two lines of the robot.
    #[serde_inline_default(20.0)]
    #[schemars(range(min = 2.0, max = 200.0))]
    pub period_ms: f64,
}

/// Parameters of its sonars.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SonarConfig {
    /// Time until every sonar has measured once.
    #[serde_inline_default(60.0)]
    #[schemars(range(min = 10.0, max = 1000.0))]
    pub period_ms: f64,
    /// Directions of the sonars in the order of the robot's lines, positive to the left.
    #[schemars(length(min = 1, max = 8), extend("examples" = [[0.0]]))]
    pub azimuths_deg: Vec<f64>,
    /// Opening angle of each.
    #[serde_inline_default(25.0)]
    #[schemars(range(min = 1.0, max = 90.0))]
    pub cone_deg: f64,
    /// Distance of each from the robot's center, in its direction.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub from_center_m: f64,
    /// Minimum range.
    #[serde_inline_default(0.02)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Maximum range; a longer echo counts as none.
    #[serde_inline_default(3.0)]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub max_m: f64,
}

/// Parameters of its drive.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicrocontrollerDriveConfig {
    /// Time without a command after which the driver stops the robot. The firmware has a watchdog of its own.
    #[serde_inline_default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
    /// Maximum speed of a wheel.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.01, max = 5.0))]
    pub max_wheel_mps: f64,
}

/// Returns the driver `microcontroller`, with sensors of the kinds `encoders`, `bumpers` and `sonars`, and a drive.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<Odometry, MeasurementConfig>(
            "encoders",
            "Wheel odometry from the encoder counts.",
        ),
        SensorOffer::new::<Bumper, MeasurementConfig>("bumpers", "Bumpers, in the bits of the firmware."),
        SensorOffer::new::<RangeScanHeader, SonarConfig>("sonars", "Sonars; a scan once each has measured."),
    ];
    let drive = DriveOffer::new::<MicrocontrollerDriveConfig>(
        "differential",
        "Two driven wheels: forward and turn. Stops by itself when commands stop, and so does the firmware.",
        Axes::PLANAR,
    );
    let summary = "Arduino, Pico or other board with two wheels that speaks the line protocol.";
    SerialDriver::arc::<MicrocontrollerConfig>(NAME, summary, sensors, vec![drive], describe, open)
}

fn describe(sensor: &PartSpec) -> Result<SensorDescription, ParameterError> {
    let name = &sensor.name;
    let period_s = || Ok(1e-3 * read::<MeasurementConfig>(&sensor.table)?.period_ms);
    Ok(match sensor.kind.as_str() {
        "encoders" => description::<Odometry>(name, period_s()?, LATENCY_S, SensorKind::Other, 0),
        "bumpers" => description::<Bumper>(name, period_s()?, LATENCY_S, SensorKind::Other, 0),
        "sonars" => {
            let config: SonarConfig = read(&sensor.table)?;
            config.geometry().check()?;
            let range = SensorKind::Range { min_m: config.min_m, max_m: config.max_m };
            let period_s = 1e-3 * config.period_ms;
            description::<RangeScanHeader>(
                name,
                period_s,
                period_s + LATENCY_S,
                range,
                config.azimuths_deg.len(),
            )
        }
        other => return Err(no_sensor(other)),
    })
}

impl SonarConfig {
    fn geometry(&self) -> RingGeometry<'_> {
        RingGeometry {
            azimuths_deg: &self.azimuths_deg,
            cone_deg: self.cone_deg,
            from_center_m: self.from_center_m,
            range_m: [self.min_m, self.max_m],
        }
    }

    fn ring(&self) -> SonarRing {
        SonarRing {
            beams: self.geometry().beams(),
            range_m: [self.min_m, self.max_m],
            read: vec![None; self.azimuths_deg.len()],
        }
    }
}

fn open(spec: &DeviceSpec) -> Result<Device, ParameterError> {
    let config: MicrocontrollerConfig = read(&spec.table)?;
    let table = spec.drive.as_ref().map(|drive| drive.table.clone()).unwrap_or_default();
    let drive: MicrocontrollerDriveConfig = read(&table)?;
    let commanded = Commanded::new(Duration::from_secs_f64(1e-3 * drive.watchdog_ms));
    let sonars = spec.sensors.iter().find(|part| part.kind == "sonars");
    let sonars = sonars.map(|part| read::<SonarConfig>(&part.table)).transpose()?;
    let ring = sonars.map(|sonars| sonars.ring()).unwrap_or_default();
    let (m_per_count, max_mps) = (1.0 / config.counts_per_m, drive.max_wheel_mps);
    let wheels = WheelGeometry { m_per_count, track_m: config.track_m, max_mps };
    let line = LineConfig { device: spec.name.clone(), port: config.port, baud: config.baud };
    let line = Line::open(line, Microcontroller::new(wheels, ring, commanded));
    let line = Arc::new(line.map_err(|error| ParameterError::new("port", error.to_string()))?);
    let sensor = |part: &PartSpec| match part.kind.as_str() {
        "encoders" => Ok(LineSensor::<_, Odometry>::boxed(&part.name, &line, |robot| robot.odometry.pop())),
        "bumpers" => Ok(LineSensor::<_, Bumper>::boxed(&part.name, &line, |robot| robot.bumpers.pop())),
        "sonars" => Ok(LineSensor::<_, RangeScanHeader>::boxed(&part.name, &line, |robot| robot.scans.pop())),
        other => Err(no_sensor(other)),
    };
    let sensors = spec.sensors.iter().map(sensor).collect::<Result<_, _>>()?;
    let drive = spec.drive.as_ref().map(|_| Box::new(LineDrive(Arc::clone(&line))) as _);
    Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
}
