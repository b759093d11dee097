//! Test doubles for devices.

use std::time::Duration;

use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{Device, DeviceSpec, DriveOffer, SensorOffer};
use yamabico_core::message::{Axes, Odometry};
use yamabico_core::testing::{FakeDriver, NoParameters, plain_sensor};

/// Period of the sensors.
pub const PERIOD: Duration = Duration::from_millis(20);

/// Driver `stand-in`, with odometry sensors of these kinds every [`PERIOD`] and planar drives of these kinds.
pub fn stand_in(
    sensors: &[&str],
    drives: &[&str],
    open: fn(DeviceSpec) -> Result<Device, ParameterError>,
) -> FakeDriver {
    let sensor = |kind: &&str| SensorOffer::new::<Odometry, NoParameters>(kind, "Odometry.");
    let drive = |kind: &&str| DriveOffer::new::<NoParameters>(kind, "Obeys.", Axes::PLANAR);
    let (sensors, drives) = (sensors.iter().map(sensor).collect(), drives.iter().map(drive).collect());
    FakeDriver::new("stand-in", open)
        .with(|info| (info.sensors, info.drives) = (sensors, drives))
        .describing(|sensor| Ok(plain_sensor::<Odometry>(&sensor.name, PERIOD.as_secs_f64(), 0)))
}
