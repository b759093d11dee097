//! Drives a base with two wheels, encoders and a sonar ahead.

use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Axes, Beam, Command, Message, NO_ECHO, Odometry, RangeScanHeader};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::sensor::{DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

/// The hardware: here, a point that moves toward a wall 4 m ahead. Replace its body by reads and writes of your serial port, CAN
/// bus or vendor library.
struct Base {
    pose: Pose2,
    twist: Twist,
    moved: Time,
    commanded: Time,
    watchdog: Duration,
}

impl Base {
    fn new(watchdog: Duration) -> Base {
        let now = Time::monotonic_now();
        Base { pose: Pose2::IDENTITY, twist: Twist::ZERO, moved: now, commanded: Time::ZERO, watchdog }
    }

    /// Reads the hardware. Stops it if no command came in time: the last line of defense when everything else died.
    fn update(&mut self, now: Time) {
        if now.since(self.commanded) > self.watchdog {
            self.twist = Twist::ZERO;
        }
        self.pose = self.pose.integrate(&self.twist, now.since(self.moved).as_secs_f64());
        self.moved = now;
    }

    fn drive(&mut self, command: &Command, now: Time) {
        self.commanded = now;
        // An emergency and a speed that is not finite stop.
        let drives = command.emergency == 0 && command.twist.is_finite();
        self.twist = if drives { command.twist } else { Twist::ZERO };
    }
}

/// Parameters of a sensor: keys of its table in the robot file. `yamabico check` refuses values out of range.
#[derive(Clone, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
struct SensorConfig {
    /// Time between measurements.
    #[default(50.0)]
    #[schemars(range(min = 1.0, max = 10000.0))]
    period_ms: f64,
}

/// Parameters of the drive.
#[derive(Clone, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
struct DriveConfig {
    /// Time without a command after which the drive stops.
    #[default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    watchdog_ms: f64,
}

/// Parameters of the device; here, none.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DeviceConfig {}

/// Maximum range of the sonar, m.
const MAX_M: f64 = 3.0;

/// One sensor of the base.
struct BaseSensor {
    name: String,
    kind: String,
    period: Duration,
    sequence: u64,
    base: Arc<Mutex<Base>>,
}

impl Sensor for BaseSensor {
    /// Publishes what is due, stamped with its capture, and returns when to be called again.
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let mut base = locked(&self.base);
        base.update(now);
        self.sequence += 1;
        let (stamp_ns, sequence) = (now.0, self.sequence);
        if self.kind == "encoders" {
            let odometry = Odometry { sequence, ..Odometry::new(stamp_ns, &base.pose, &base.twist) };
            outputs.publish(&self.name, &odometry, &[])?;
        } else {
            let ahead_m = 4.0 - base.pose.x;
            let flags = if ahead_m > MAX_M { NO_ECHO } else { 0 };
            let beam = Beam { cone_rad: 0.4, range_m: ahead_m.min(MAX_M), flags, ..Beam::default() };
            let header = RangeScanHeader { stamp_ns, sequence, min_m: 0.02, max_m: MAX_M };
            outputs.publish(&self.name, &header, &[beam])?;
        }
        Ok(Due::At(now + self.period))
    }
}

/// The drive of the base.
struct BaseDrive(Arc<Mutex<Base>>);

impl Drive for BaseDrive {
    /// Called with each command, and without one in between.
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError> {
        let mut base = locked(&self.0);
        if let Some(command) = command {
            base.drive(command, now);
        }
        base.update(now);
        Ok(())
    }
}

fn locked(base: &Mutex<Base>) -> MutexGuard<'_, Base> {
    base.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The driver.
struct MyDriver(DriverInfo);

fn driver() -> Arc<dyn Driver> {
    Arc::new(MyDriver(DriverInfo {
        name: env!("CARGO_PKG_NAME").to_owned(),
        summary: "A base with two wheels, encoders and a sonar ahead.".to_owned(),
        parameters: schema_of::<DeviceConfig>(),
        files: Vec::new(),
        sensors: vec![
            SensorOffer::new::<Odometry, SensorConfig>("encoders", "Wheel odometry."),
            SensorOffer::new::<RangeScanHeader, SensorConfig>("sonar", "One sonar that looks ahead."),
        ],
        drives: vec![DriveOffer::new::<DriveConfig>("differential", "Two driven wheels.", Axes::PLANAR)],
    }))
}

impl Driver for MyDriver {
    fn info(&self) -> &DriverInfo {
        &self.0
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let config: SensorConfig = read(&sensor.table)?;
        let is_sonar = sensor.kind == "sonar";
        let range = SensorKind::Range { min_m: 0.02, max_m: MAX_M };
        let info = SensorInfo {
            name: sensor.name.clone(),
            message: if is_sonar { RangeScanHeader::NAME } else { Odometry::NAME },
            period_s: 1e-3 * config.period_ms,
            latency_s: 0.0,
            kind: if is_sonar { range } else { SensorKind::Other },
        };
        Ok(SensorDescription { info, max_item_bytes: if is_sonar { size_of::<Beam>() } else { 0 } })
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        let drive = spec.drive.as_ref().map(|part| read::<DriveConfig>(&part.table)).transpose()?;
        let watchdog_ms = drive.unwrap_or_default().watchdog_ms;
        let base = Arc::new(Mutex::new(Base::new(Duration::from_secs_f64(1e-3 * watchdog_ms))));
        let sensor = |part: &PartSpec| -> Result<(String, Box<dyn Sensor>), ParameterError> {
            let config: SensorConfig = read(&part.table)?;
            let sensor = BaseSensor {
                name: part.name.clone(),
                kind: part.kind.clone(),
                period: Duration::from_secs_f64(1e-3 * config.period_ms),
                sequence: 0,
                base: Arc::clone(&base),
            };
            Ok((part.name.clone(), Box::new(sensor)))
        };
        let sensors = spec.sensors.iter().map(sensor).collect::<Result<_, _>>()?;
        let drive = spec.drive.map(|_| Box::new(BaseDrive(base)) as Box<dyn Drive>);
        Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
    }
}

fn main() -> ExitCode {
    yamabico_host::process::main_of_driver(driver())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_drives_and_stops_when_commands_stop() {
        let mut base = Base::new(Duration::from_millis(200));
        let begin = base.moved;
        base.drive(&Command { twist: Twist::planar(0.5, 0.0), ..Command::default() }, begin);
        base.update(begin + Duration::from_millis(100));
        assert!((base.pose.x - 0.05).abs() < 1e-9);
        base.update(begin + Duration::from_millis(300));
        assert!((base.pose.x - 0.05).abs() < 1e-9 && base.twist == Twist::ZERO);
    }

    #[test]
    fn an_emergency_stops() {
        let mut base = Base::new(Duration::from_millis(200));
        let begin = base.moved;
        base.drive(&Command { twist: Twist::planar(0.5, 0.0), emergency: 1, ..Command::default() }, begin);
        base.update(begin + Duration::from_millis(100));
        assert_eq!(base.pose, Pose2::IDENTITY);
    }
}
