//! Sensors that go wrong in the hallway: the robot comes to a stand and stays there, or goes on unharmed; nothing panics.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bytemuck::Pod;
use yamabico::plugins::plugins;
use yamabico_core::behavior::{BuildError, Outputs, PublishError};
use yamabico_core::driver::{Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription};
use yamabico_core::message::{
    Beam, Command, FrameHeader, Message, MessageType, Odometry, RangeScanHeader, RawMessage, Truth,
};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, Ran, run};

/// When the sensor goes wrong: the robot has its speed by then, and has met nobody yet.
const WRONG: Time = Time(2_000_000_000);
/// From then on it must stand: old evidence is good for a second, and braking takes half a one.
const STAND: Time = Time(4_000_000_000);

/// What a sensor does from [`WRONG`] on.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Silent,
    Empty,
    NoNumber,
    FromTheFuture,
    FromThePast,
    None,
}

/// A sensor whose messages are damaged on their way.
struct Damaged {
    name: String,
    sensor: Box<dyn Sensor>,
    fault: Fault,
}

impl Sensor for Damaged {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        if now < WRONG {
            return self.sensor.poll(now, outputs);
        }
        let mut said = Published::default();
        let due = self.sensor.poll(now, &mut Outputs::new(&mut said))?;
        for (_, message, RawMessage { header, items }) in said.iter() {
            match message.name {
                RangeScanHeader::NAME => self.pass_on::<RangeScanHeader>(header, items, outputs)?,
                FrameHeader::NAME => self.pass_on::<FrameHeader>(header, items, outputs)?,
                _ => self.pass_on::<Odometry>(header, items, outputs)?,
            }
        }
        Ok(due)
    }
}

/// A message with something to damage.
trait Damage: Message {
    fn restamp(&mut self, shift: fn(u64) -> u64);
    fn spoil(&mut self, items: &mut [Self::Item]);
}

impl Damage for RangeScanHeader {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    fn spoil(&mut self, beams: &mut [Beam]) {
        for beam in beams {
            (beam.range_m, beam.flags) = (f64::NAN, 0);
        }
    }
}

impl Damage for FrameHeader {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    /// A picture has no room for what is no number; what it says of its size can be nonsense.
    fn spoil(&mut self, _: &mut [u8]) {
        (self.exposure, self.stride) = (f64::NAN, u32::MAX);
    }
}

impl Damage for Odometry {
    fn restamp(&mut self, shift: fn(u64) -> u64) {
        self.stamp_ns = shift(self.stamp_ns);
    }

    fn spoil(&mut self, _: &mut [u8]) {
        (self.x, self.y, self.theta, self.vx, self.omega) =
            (f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN);
    }
}

impl Damaged {
    fn pass_on<M: Damage>(
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
            Fault::NoNumber => header.spoil(&mut items),
            Fault::FromTheFuture => header.restamp(|stamp_ns| stamp_ns + 60_000_000_000),
            Fault::FromThePast => header.restamp(|stamp_ns| stamp_ns / 1000),
        }
        outputs.publish(&self.name, &header, &items)
    }
}

/// The simulator with one sensor that goes wrong.
struct FaultySimulator {
    simulator: Arc<dyn Driver>,
    sensor: &'static str,
    fault: Fault,
}

impl Driver for FaultySimulator {
    fn info(&self) -> &DriverInfo {
        self.simulator.info()
    }

    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, BuildError> {
        self.simulator.describe_sensor(sensor, folder)
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, BuildError> {
        let mut device = self.simulator.open(spec)?;
        let sensors = device.sensors.into_iter().map(|(name, sensor)| {
            let is_faulty = name == self.sensor;
            let damaged = |sensor| Box::new(Damaged { name: name.clone(), sensor, fault: self.fault });
            let sensor = if is_faulty { damaged(sensor) as Box<dyn Sensor> } else { sensor };
            (name, sensor)
        });
        device.sensors = sensors.collect();
        Ok(device)
    }
}

/// How fast the robot was when, and what the motors were told.
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
                self.true_mps.push((time, truth.vx.hypot(truth.vy)));
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
    fn fastest_mps(&self, from: Time, to: Time) -> f64 {
        let within = self.true_mps.iter().filter(|(time, _)| (from..to).contains(time));
        within.map(|&(_, speed)| speed).fold(0.0, f64::max)
    }
}

fn drive(sensor: &'static str, fault: Fault) -> (Ran, Speeds) {
    let driver = FaultySimulator { simulator: yamabico_sim::driver(), sensor, fault };
    let plugins = Plugins { drivers: vec![Arc::new(driver)], ..plugins() };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hallway.toml");
    let mut task =
        load(&path, &Overrides::default(), &plugins).unwrap_or_else(|problems| panic!("{problems}"));
    task.run.duration = Some(Duration::from_secs(6));
    let mut speeds = Speeds::default();
    let ran = run(&task, &Options::default(), &AtomicBool::new(false), &mut speeds, &mut |_| {}).unwrap();
    assert_eq!((ran.end, ran.is_done(), ran.summary.contacts), (End::TimeOver, false, Some(0)));
    assert!(speeds.commands >= 300, "{} commands in six seconds", speeds.commands);
    let before = speeds.fastest_mps(Time::ZERO, WRONG);
    assert!(before > 0.3, "it had {before} m/s before the sensor went wrong");
    (ran, speeds)
}

fn stands(sensor: &'static str, fault: Fault) {
    let (_, speeds) = drive(sensor, fault);
    let after = speeds.fastest_mps(STAND, Time(u64::MAX));
    assert!(after < 0.01, "{sensor} {fault:?}: it moved at {after} m/s");
}

#[test]
fn a_sound_robot_drives_on() {
    let (_, speeds) = drive("sonar", Fault::None);
    assert!(speeds.fastest_mps(STAND, Time(u64::MAX)) > 0.3);
}

#[test]
fn a_silent_sonar_stops_the_robot() {
    stands("sonar", Fault::Silent);
}

#[test]
fn an_empty_scan_stops_the_robot() {
    stands("sonar", Fault::Empty);
}

#[test]
fn ranges_that_are_no_numbers_stop_the_robot() {
    stands("sonar", Fault::NoNumber);
}

#[test]
fn ranges_from_another_time_stop_the_robot() {
    stands("sonar", Fault::FromTheFuture);
    stands("sonar", Fault::FromThePast);
}

#[test]
fn a_silent_camera_stops_the_robot() {
    stands("front", Fault::Silent);
}

#[test]
fn pictures_that_are_none_stop_the_robot() {
    stands("front", Fault::Empty);
    stands("front", Fault::NoNumber);
}

#[test]
fn pictures_from_another_time_stop_the_robot() {
    stands("front", Fault::FromTheFuture);
    stands("front", Fault::FromThePast);
}

#[test]
fn wheels_that_go_wrong_cost_no_contact() {
    drive("wheels", Fault::Silent);
    drive("wheels", Fault::NoNumber);
    drive("wheels", Fault::FromTheFuture);
    drive("wheels", Fault::FromThePast);
}
