//! An open device with its messages, as the framework runs it.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, Driver, PartSpec};
use yamabico_core::geometry::Twist;
use yamabico_core::message::{Command, Message};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::Published;
use yamabico_core::time::Time;

/// Time in which a watchdog of 200 ms has stopped the robot, s, on a busy machine; an idle one takes 0.22.
pub const MAX_STOP_S: f64 = 0.6;

/// An open device.
pub struct Bench {
    device: Device,
    published: Published,
    /// Commanded twist; commands stop without one.
    pub twist: Option<Twist>,
}

impl Bench {
    /// Opens a device with the sensors (kind, keys), each named like its kind, and a drive with these keys.
    pub fn open(
        driver: &Arc<dyn Driver>,
        port: &Path,
        keys: &str,
        sensors: &[(&str, &str)],
        drive: Option<&str>,
    ) -> Bench {
        let device = driver.open(spec(port, keys, sensors, drive));
        let device = device.map_err(|error| error.to_string()).unwrap();
        Bench { device, published: Published::default(), twist: None }
    }

    /// Runs for `seconds`: polls and commands every 10 ms.
    pub fn run(&mut self, seconds: f64) {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < end {
            self.step();
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Runs until `is_done`, and returns the time that it took, s. Fails after `max_s`.
    pub fn run_until(
        &mut self,
        max_s: f64,
        reason: &str,
        mut is_done: impl FnMut(&mut Bench) -> bool,
    ) -> f64 {
        let begin = Instant::now();
        while !is_done(self) {
            assert!(begin.elapsed().as_secs_f64() < max_s, "{reason}");
            self.step();
            std::thread::sleep(Duration::from_millis(5));
        }
        begin.elapsed().as_secs_f64()
    }

    fn step(&mut self) {
        let now = Time::monotonic_now();
        for (_, sensor) in &mut self.device.sensors {
            sensor.poll(now, &mut Outputs::new(&mut self.published)).unwrap();
        }
        if let Some(drive) = &mut self.device.drive {
            let command = self.twist.map(|twist| Command { stamp_ns: now.0, twist, ..Command::default() });
            drive.apply(command.as_ref(), now).unwrap();
        }
    }

    /// Removes and returns the messages of a sensor.
    pub fn take<M: Message>(&mut self, sensor: &str) -> Vec<(M, Vec<M::Item>)> {
        let messages = self.published.of::<M>(sensor);
        self.published.clear();
        messages
    }

    pub fn messages<M: Message>(&self, sensor: &str) -> Vec<M> {
        self.published.of::<M>(sensor).into_iter().map(|(header, _)| header).collect()
    }
}

pub fn spec(port: &Path, keys: &str, sensors: &[(&str, &str)], drive: Option<&str>) -> DeviceSpec {
    let mut table: toml::Table = toml::from_str(keys).unwrap();
    table.insert("port".into(), port.to_string_lossy().into_owned().into());
    let part = |name: &str, kind: &str, keys: &str| PartSpec {
        name: name.into(),
        kind: kind.into(),
        table: toml::from_str(keys).unwrap(),
    };
    DeviceSpec {
        name: "base".into(),
        table,
        sensors: sensors.iter().map(|(kind, keys)| part(kind, kind, keys)).collect(),
        drive: drive.map(|keys| part("drive", "differential", keys)),
        folder: "/".into(),
        seed: 1,
        robot: Robot::default(),
    }
}
