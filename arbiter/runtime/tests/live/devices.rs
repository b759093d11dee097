//! Test doubles for devices: wheels that measure, and a motor that records its commands.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{Device, DeviceSpec};
use yamabico_core::message::{Command, Odometry};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::stand_ins::PERIOD;

/// Number of polls or commands before a failure, 0.3 s; a sensor fails only once the body moves.
pub const LIFE: u64 = 15;

/// Number of messages in a burst: more than the 1024 that a recorder buffers.
pub const FLOOD: u64 = 1100;

/// Speeds commanded to each robot's drive, m/s.
pub static GIVEN: Mutex<BTreeMap<String, Vec<f64>>> = Mutex::new(BTreeMap::new());

/// Odometry of a body that moves as commanded; some kinds fail or end.
pub struct Wheels {
    name: String,
    kind: String,
    speed: Arc<Mutex<f64>>,
    polls: u64,
    sequence: u64,
}

impl Sensor for Wheels {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        self.polls += 1;
        let speed = *self.speed.lock().unwrap();
        let is_driven = speed > super::DRIVING_MPS;
        match self.kind.as_str() {
            "failing" if self.polls > LIFE && is_driven => {
                return Err(DeviceError::failed(&self.name, "the cable is off"));
            }
            "panicking" if self.polls > LIFE && is_driven => panic!("the cable is off"),
            "ending" if self.polls > LIFE => return Ok(Due::Ended),
            _ => {}
        }
        let vx = if self.kind == "not-finite" { f64::NAN } else { speed };
        let messages = if self.kind == "flooding" && self.polls == 2 { FLOOD } else { 1 };
        for _ in 0..messages {
            self.sequence += 1;
            let header =
                Odometry { stamp_ns: now.0, sequence: self.sequence, vx, x: vx, ..Default::default() };
            outputs.publish(&self.name, &header, &[])?;
        }
        Ok(Due::At(now + PERIOD))
    }
}

pub struct Motor {
    robot: String,
    kind: String,
    speed: Arc<Mutex<f64>>,
    commands: u64,
}

impl Drive for Motor {
    fn apply(&mut self, command: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        let Some(command) = command else { return Ok(()) };
        self.commands += 1;
        assert!(self.kind != "panicking" || self.commands <= LIFE, "the motor is off");
        *self.speed.lock().unwrap() = command.twist.linear;
        GIVEN.lock().unwrap().entry(self.robot.clone()).or_default().push(command.twist.linear);
        Ok(())
    }
}

pub fn open(spec: DeviceSpec) -> Result<Device, ParameterError> {
    if spec.sensors.iter().any(|sensor| sensor.kind == "unplugged") {
        return Err(ParameterError::new("", "nothing is plugged in"));
    }
    let speed = Arc::new(Mutex::new(0.0));
    let sensors = spec.sensors.iter().map(|sensor| {
        let (name, kind) = (sensor.name.clone(), sensor.kind.clone());
        let wheels = Wheels { name: name.clone(), kind, speed: Arc::clone(&speed), polls: 0, sequence: 0 };
        (name, Box::new(wheels) as Box<dyn Sensor>)
    });
    let sensors = sensors.collect();
    let motor = |drive: yamabico_core::driver::PartSpec| {
        Box::new(Motor { robot: spec.robot.name.clone(), kind: drive.kind, speed, commands: 0 }) as _
    };
    Ok(Device { sensors, drive: spec.drive.map(motor), ground_truth: None, walls: Vec::new() })
}

pub const SENSORS: [&str; 7] =
    ["lasting", "failing", "panicking", "ending", "unplugged", "not-finite", "flooding"];
pub const DRIVES: [&str; 2] = ["motor", "panicking"];
