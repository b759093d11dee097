//! Faults of sensors in the hallway: the robot stops and stays at rest, or continues without contact; nothing panics.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bytemuck::Pod;
use yamabico::plugins::plugins;
use yamabico_core::behavior::{Outputs, ParameterError, PublishError};
use yamabico_core::driver::{Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription};
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{
    Beam, Command, FrameHeader, Message, MessageType, Odometry, RangeScanHeader, RawMessage, Truth,
};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, RunResult, run};

/// Time of the fault: the robot drives at its speed and has not met the person yet.
const FAULT: Time = Time(2_000_000_000);
/// Time from which the robot must be at rest: old evidence is valid for 1 s, and braking takes 0.5 s.
const AT_REST: Time = Time(4_000_000_000);

/// Behavior of a sensor from [`FAULT`] on.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Silent,
    Empty,
    NotANumber,
    FromTheFuture,
    FromThePast,
    None,
}

/// A sensor whose messages are corrupted.
struct CorruptedSensor {
    name: String,
    sensor: Box<dyn Sensor>,
    fault: Fault,
}

impl Sensor for CorruptedSensor {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        if now < FAULT {
            return self.sensor.poll(now, outputs);
        }
        let mut published = Published::default();
        let due = self.sensor.poll(now, &mut Outputs::new(&mut published))?;
        for (_, message, RawMessage { header, items }) in published.iter() {
            match message.name {
                RangeScanHeader::NAME => self.forward::<RangeScanHeader>(header, items, outputs)?,
                FrameHeader::NAME => self.forward::<FrameHeader>(header, items, outputs)?,
                _ => self.forward::<Odometry>(header, items, outputs)?,
            }
        }
        Ok(due)
    }
}

/// A message that can be corrupted.
trait Corrupt: Message {
    fn restamp(&mut self, shift: fn(u64) -> u64);
    fn invalidate(&mut self, items: &mut [Self::Item]);
}

impl Corrupt for RangeScanHeader {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    fn invalidate(&mut self, beams: &mut [Beam]) {
        for beam in beams {
            (beam.range_m, beam.flags) = (f64::NAN, 0);
        }
    }
}

impl Corrupt for FrameHeader {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    /// Pixels cannot be NaN, but the header can contradict the image.
    fn invalidate(&mut self, _: &mut [u8]) {
        (self.exposure, self.stride) = (f64::NAN, u32::MAX);
    }
}

impl Corrupt for Odometry {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    fn invalidate(&mut self, _: &mut [u8]) {
        (self.x, self.y, self.theta, self.vx, self.omega) =
            (f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN);
    }
}

impl CorruptedSensor {
    fn forward<M: Corrupt>(
        &self,
        header: &[u8],
        items: &[u8],
        outputs: &mut Outputs<'_>,
    ) -> Result<(), PublishError>
    where
        M::Item: Pod,
    {
        let mut header: M = bytemuck::pod_read_unaligned(header);
        let mut items: Vec<M::Item> = bytemuck::pod_collect_to_vec(items);
        match self.fault {
            Fault::None => {}
            Fault::Silent => return Ok(()),
            Fault::Empty => items.clear(),
            Fault::NotANumber => header.invalidate(&mut items),
            Fault::FromTheFuture => header.restamp(|stamp_ns| stamp_ns + 60_000_000_000),
            Fault::FromThePast => header.restamp(|stamp_ns| stamp_ns / 1000),
        }
        outputs.publish(&self.name, &header, &items)
    }
}

/// The simulator with one faulty sensor.
struct FaultySimulator {
    simulator: Arc<dyn Driver>,
    sensor: &'static str,
    fault: Fault,
}

impl Driver for FaultySimulator {
    fn info(&self) -> &DriverInfo {
        self.simulator.info()
    }

    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, ParameterError> {
        self.simulator.describe_sensor(sensor, folder)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        let mut device = self.simulator.open(spec)?;
        let sensors = device.sensors.into_iter().map(|(name, sensor)| {
            let is_faulty = name == self.sensor;
            let corrupted =
                |sensor| Box::new(CorruptedSensor { name: name.clone(), sensor, fault: self.fault });
            let sensor = if is_faulty { corrupted(sensor) as Box<dyn Sensor> } else { sensor };
            (name, sensor)
        });
        device.sensors = sensors.collect();
        Ok(device)
    }
}

/// True speeds, and the number of commands.
#[derive(Default)]
struct Speeds {
    true_mps: Vec<(Time, f64)>,
    commands: u64,
}

impl Tap for Speeds {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], _: &[u8]) {
        match message.name {
            Truth::NAME => {
                let truth: Truth = bytemuck::pod_read_unaligned(header);
                self.true_mps.push((time, truth.vx.hypotenuse(truth.vy)));
            }
            Command::NAME => {
                let command: Command = bytemuck::pod_read_unaligned(header);
                assert!(command.twist.linear.is_finite() && command.twist.angular.is_finite(), "{command:?}");
                self.commands += 1;
            }
            _ => {}
        }
    }
}

impl Speeds {
    fn max_mps(&self, from: Time, to: Time) -> f64 {
        let within = self.true_mps.iter().filter(|(time, _)| (from..to).contains(time));
        within.map(|&(_, speed)| speed).fold(0.0, f64::max)
    }
}

fn drive(sensor: &'static str, fault: Fault) -> (RunResult, Speeds) {
    let driver = FaultySimulator { simulator: yamabico_sim::driver(), sensor, fault };
    let plugins = Plugins { drivers: vec![Arc::new(driver)], ..plugins() };
    let path = yamabico_testkit::config("hallway.toml");
    let mut task =
        load(&path, &Overrides::default(), &plugins).unwrap_or_else(|problems| panic!("{problems}"));
    task.run.duration = Some(Duration::from_secs(6));
    let mut speeds = Speeds::default();
    let result = run(&task, &Options::default(), &AtomicBool::new(false), &mut speeds, &mut |_| {}).unwrap();
    assert_eq!((result.end, result.is_done(), result.summary.contacts), (RunEnd::TimeOver, false, Some(0)));
    assert!(speeds.commands >= 300, "{} commands in six seconds", speeds.commands);
    let before = speeds.max_mps(Time::ZERO, FAULT);
    assert!(before > 0.3, "only {before} m/s before the fault");
    (result, speeds)
}

fn assert_stops(sensor: &'static str, fault: Fault) {
    let (_, speeds) = drive(sensor, fault);
    let after = speeds.max_mps(AT_REST, Time(u64::MAX));
    assert!(after < 0.01, "{sensor} {fault:?}: still {after} m/s");
}

#[test]
fn without_a_fault_the_robot_continues() {
    let (_, speeds) = drive("sonar", Fault::None);
    assert!(speeds.max_mps(AT_REST, Time(u64::MAX)) > 0.3);
}

#[test]
fn a_silent_sonar_stops_the_robot() {
    assert_stops("sonar", Fault::Silent);
}

#[test]
fn an_empty_scan_stops_the_robot() {
    assert_stops("sonar", Fault::Empty);
}

#[test]
fn ranges_that_are_not_numbers_stop_the_robot() {
    assert_stops("sonar", Fault::NotANumber);
}

#[test]
fn ranges_from_another_time_stop_the_robot() {
    assert_stops("sonar", Fault::FromTheFuture);
    assert_stops("sonar", Fault::FromThePast);
}

#[test]
fn a_silent_camera_stops_the_robot() {
    assert_stops("front", Fault::Silent);
}

#[test]
fn invalid_frames_stop_the_robot() {
    assert_stops("front", Fault::Empty);
    assert_stops("front", Fault::NotANumber);
}

#[test]
fn frames_from_another_time_stop_the_robot() {
    assert_stops("front", Fault::FromTheFuture);
    assert_stops("front", Fault::FromThePast);
}

#[test]
fn faulty_odometry_causes_no_contact() {
    drive("wheels", Fault::Silent);
    drive("wheels", Fault::NotANumber);
    drive("wheels", Fault::FromTheFuture);
    drive("wheels", Fault::FromThePast);
}
