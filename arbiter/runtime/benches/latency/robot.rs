//! The live robot: a camera and a drive in one device, and a behavior that does nothing.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{
    Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{Device, DeviceSpec, DriveOffer, SensorOffer};
use yamabico_core::message::{Axes, Command, FrameHeader, Proposal, Twist};
use yamabico_core::parameters::schema_of;
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::testing::{FakeDriver, NoParameters, plain_sensor};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, Task, load};

use super::{FRAME, PERIOD};

/// Plugins of the robot.
pub fn plugins() -> Plugins {
    let camera = SensorOffer::new::<FrameHeader, NoParameters>("camera", "Frames.");
    let clock = DriveOffer::new::<NoParameters>("clock", "Obeys.", Axes::PLANAR);
    let probe = FakeDriver::new("probe", open)
        .with(|info| {
            info.parameters = schema_of::<Keys>();
            (info.sensors, info.drives) = (vec![camera], vec![clock]);
        })
        .describing(|sensor| Ok(plain_sensor::<FrameHeader>(&sensor.name, PERIOD.as_secs_f64(), FRAME)));
    Plugins { behaviors: vec![factory::<Idler>()], drivers: vec![probe.shared()] }
}

#[derive(Deserialize, JsonSchema)]
struct Keys {
    /// Frames to measure.
    frames: usize,
    /// File of the latencies.
    file: String,
}

const CAMERA: Slot<FrameHeader> = Slot::required("camera", "Frames that wake it.");

/// Proposes a standstill, whatever it receives.
struct Idler;

impl Plugin for Idler {
    type Config = NoParameters;
    const NAME: &'static str = "idler";
    const SUMMARY: &'static str = "Does nothing.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Idler)
    }
}

impl Behavior for Idler {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::drive(Axes::PLANAR, Twist::ZERO)
    }
}

/// Stamp of the frame that has not come back yet.
type Sent = Arc<Mutex<Option<u64>>>;

fn open(spec: DeviceSpec) -> Result<Device, ParameterError> {
    let keys: Keys = spec.table.try_into().map_err(|error| ParameterError::new("", format!("{error}")))?;
    let sent = Sent::default();
    let camera = Camera { sent: Arc::clone(&sent), sequence: 0 };
    let watch = Watch { sent, latencies: Vec::with_capacity(keys.frames), keys };
    Ok(Device {
        sensors: vec![("camera".into(), Box::new(camera) as Box<dyn Sensor>)],
        drive: Some(Box::new(watch)),
        ground_truth: None,
        walls: Vec::new(),
    })
}

struct Camera {
    sent: Sent,
    sequence: u64,
}

impl Sensor for Camera {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        self.sequence += 1;
        let stamp_ns = Time::monotonic_now().0;
        *self.sent.lock().unwrap() = Some(stamp_ns);
        let header = FrameHeader {
            stamp_ns,
            sequence: self.sequence,
            width: 640,
            height: 480,
            stride: 640,
            ..Default::default()
        };
        outputs.publish_in_place("camera", &header, FRAME, |bytes| bytes.fill(1))?;
        Ok(Due::At(now + PERIOD))
    }
}

struct Watch {
    sent: Sent,
    latencies: Vec<u64>,
    keys: Keys,
}

impl Drive for Watch {
    fn apply(&mut self, command: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        let Some(command) = command else { return Ok(()) };
        let mut sent = self.sent.lock().unwrap();
        if *sent != Some(command.evidence_ns) {
            return Ok(());
        }
        *sent = None;
        self.latencies.push(Time::monotonic_now().0 - command.evidence_ns);
        if self.latencies.len() == self.keys.frames {
            let lines: Vec<String> = self.latencies.iter().map(u64::to_string).collect();
            // Renamed into place, so that the file appears with all of its content.
            let part = format!("{}.part", self.keys.file);
            std::fs::write(&part, lines.join("\n")).unwrap();
            std::fs::rename(part, &self.keys.file).unwrap();
        }
        Ok(())
    }
}

/// File of the latencies.
pub fn figures(folder: &Path) -> PathBuf {
    folder.join("latencies")
}

/// Reads the latencies, ns.
pub fn read(path: &Path) -> Vec<u64> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| line.parse().unwrap()).collect()
}

/// The task, in `folder`.
pub fn task(folder: &Path, frames: usize) -> Task {
    let file = figures(folder);
    let robot = format!(
        "name = \"latency-{}\"\nfootprint = {{ radius_m = 0.2 }}\n\
         devices.probe = {{ driver = \"probe\", frames = {frames}, file = \"{}\" }}\n\
         sensors.camera = {{ device = \"probe\", kind = \"camera\" }}\n\
         drive = {{ device = \"probe\", kind = \"clock\" }}\n",
        std::process::id(),
        file.display()
    );
    std::fs::write(folder.join("robot.toml"), robot).unwrap();
    let task = "robot = \"robot.toml\"\n[behaviors.idler]\npriority = 1\ninputs = { camera = \"camera\" }\n";
    std::fs::write(folder.join("task.toml"), task).unwrap();
    let task = load(&folder.join("task.toml"), &Overrides::default(), &plugins());
    task.unwrap_or_else(|problems| panic!("{problems}"))
}
