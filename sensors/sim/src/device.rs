//! Driver of the simulator.

mod bumpers;
mod camera;
mod frames;
mod ground_truth;
mod lidar;
mod mirror_camera;
mod motors;
mod odometry;
mod sonars;
mod sway;

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

use rand::RngExt;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, Beam, Bumper, FrameHeader, Message, MessageType, Odometry, RangeScanHeader,
};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::sensor::{DeviceError, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use crate::Scene;
use crate::body::Body;
use crate::encoder::{EncoderConfig, Wheels};
use crate::simulation::{Simulation, Skid};
use crate::sonar::SonarConfig;
use crate::world::{WORLD_FILE, World};

pub use bumpers::BumperConfig;
pub use camera::CameraConfig;
pub use lidar::LidarConfig;
pub use mirror_camera::MirrorCameraConfig;
pub use motors::MotorConfig;
pub use sway::SwayConfig;

/// Returns the driver `sim`, with cameras, mirror cameras, sonars, laser scanners, bumpers, wheel encoders, and two kinds of drive.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let sensors = vec![
        SensorOffer::new::<FrameHeader, CameraConfig>(
            "camera",
            "Frames of a pinhole camera, rendered at the exposure and delivered after the latency.",
        ),
        SensorOffer::new::<FrameHeader, MirrorCameraConfig>(
            "mirror-camera",
            "Frames of an omnidirectional camera with a conic, hyperboloidal or measured mirror.",
        ),
        SensorOffer::new::<RangeScanHeader, SonarConfig>(
            "sonar",
            "Ranges of ultrasonic sonars with wide cones, lost echoes and noise.",
        ),
        SensorOffer::new::<RangeScanHeader, LidarConfig>(
            "lidar",
            "Ranges of a laser scanner, in place of sonars, with lost ranges and noise.",
        ),
        SensorOffer::new::<Bumper, BumperConfig>("bumper", "A left and a right bumper at the front."),
        SensorOffer::new::<Odometry, EncoderConfig>(
            "encoders",
            "Wheel-encoder odometry with quantization, slip and wheel-radius errors.",
        ),
    ];
    let drives = vec![
        DriveOffer::new::<MotorConfig>("differential", "Two driven wheels: forward and turn.", Axes::PLANAR),
        DriveOffer::new::<MotorConfig>(
            "holonomic",
            "Omnidirectional wheels: forward, sideways and turn.",
            Axes::ALL,
        ),
    ];
    Arc::new(SimDriver {
        info: DriverInfo {
            name: "sim".into(),
            summary:
                "A simulated world with its own time, cameras, ranges, bumpers, wheel encoders and a body."
                    .into(),
            parameters: schema_of::<SimConfig>(),
            files: vec![WORLD_FILE],
            sensors,
            drives,
        },
    })
}

struct SimDriver {
    info: DriverInfo,
}

impl Driver for SimDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let (name, table) = (sensor.name.as_str(), &sensor.table);
        let (info, max_item_bytes) = match sensor.kind.as_str() {
            "camera" => {
                let config: CameraConfig = read(table)?;
                (config.info(name)?, config.bytes())
            }
            "mirror-camera" => {
                let config: MirrorCameraConfig = read(table)?;
                (config.info(name)?, config.bytes())
            }
            "sonar" => {
                let config: SonarConfig = read(table)?;
                (sonars::info(&config, name)?, config.azimuths_deg.len() * size_of::<Beam>())
            }
            "lidar" => read::<LidarConfig>(table)?.info(name)?,
            "bumper" => {
                let config: BumperConfig = read(table)?;
                (info::<Bumper>(name, config.period_ms, config.latency_ms, SensorKind::Other), 0)
            }
            "encoders" => {
                let config: EncoderConfig = read(table)?;
                (info::<Odometry>(name, config.period_ms, config.latency_ms, SensorKind::Other), 0)
            }
            other => return Err(no_sensor(other)),
        };
        Ok(SensorDescription { info, max_item_bytes })
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        open(spec)
    }
}

fn no_sensor(kind: &str) -> ParameterError {
    ParameterError::new("kind", format!("the simulator has no sensor `{kind}`"))
}

/// Parameters of the simulated device.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimConfig {
    /// Path of the world file, relative to the robot file.
    #[schemars(extend("format" = "file"))]
    pub world: String,
    /// Presence of boxes and people in the building.
    #[serde(default)]
    pub clutter: Clutter,
    /// Initial pose of the robot.
    #[serde(default)]
    pub start: Start,
    /// Height of the robot; it passes under higher objects.
    #[serde_inline_default(1.0)]
    #[schemars(range(min = 0.05, max = 3.0))]
    pub body_height_m: f64,
    /// Period of the ground truth.
    #[serde_inline_default(20.0)]
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub truth_period_ms: f64,
}

/// Presence of boxes and people in the building.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Clutter {
    /// All boxes and people of the world file.
    #[default]
    AsWritten,
    /// No boxes and no people, for learning the appearance of the empty building.
    None,
}

/// Initial pose, with a random offset drawn from the seed.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Start {
    /// Position along the world's x axis.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub x_m: f64,
    /// Position along the world's y axis.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub y_m: f64,
    /// Heading, positive to the left.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub heading_deg: f64,
    /// Maximum sideways offset drawn from the seed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub jitter_m: f64,
    /// Maximum rotation drawn from the seed.
    #[schemars(range(min = 0.0, max = 180.0))]
    pub jitter_deg: f64,
}

fn open(spec: DeviceSpec) -> Result<Device, ParameterError> {
    let config: SimConfig = read(&spec.table)?;
    let path = spec.folder.join(&config.world);
    let refused =
        |e: &dyn std::fmt::Display| ParameterError::new("world", format!("{}: {e}", path.display()));
    let text = std::fs::read_to_string(&path).map_err(|e| refused(&e))?;
    let mut world = World::from_toml(&text).map_err(|e| refused(&e))?;
    if config.clutter == Clutter::None {
        world.boxes.clear();
        world.people.clear();
    }
    let scene = Scene::new(&world, spec.seed).map_err(|e| refused(&e))?;

    let motors = spec.drive.as_ref().map(|d| read::<MotorConfig>(&d.table)).transpose()?.unwrap_or_default();
    let axes = match spec.drive.as_ref().map(|d| d.kind.as_str()) {
        Some("holonomic") => [true; 3],
        _ => [true, false, true],
    };
    let body = Body::new(start_pose(&config.start, spec.seed), motors.body_limits(&spec.robot.limits, axes));
    let walls = scene.floor_plan();
    let simulation = Simulation::new(scene, body, spec.robot.radius_m, config.body_height_m);
    let skid = (motors.stop_skid_deg > 0.0).then(|| Skid {
        sigma_rad: motors.stop_skid_deg.to_radians(),
        random: crate::random::stream(spec.seed, "skid"),
    });
    let simulation = match skid {
        Some(skid) => simulation.with_skid(skid),
        None => simulation,
    };
    let simulation = Arc::new(Mutex::new(simulation));

    let mut sensors: Vec<(String, Box<dyn Sensor>)> = Vec::new();
    for part in &spec.sensors {
        let (name, sim, seed) = (part.name.as_str(), Arc::clone(&simulation), spec.seed);
        let sensor: Box<dyn Sensor> = match part.kind.as_str() {
            "camera" => Box::new(camera::camera_sensor(name, read(&part.table)?, sim, seed)),
            "mirror-camera" => {
                Box::new(mirror_camera::mirror_camera_sensor(name, &read(&part.table)?, sim, seed)?)
            }
            "sonar" => Box::new(sonars::Sonars::new(name, read(&part.table)?, sim, seed)),
            "lidar" => Box::new(lidar::Lidar::new(name, read(&part.table)?, sim, seed)),
            "bumper" => Box::new(bumpers::Bumpers::new(name, read(&part.table)?, sim)),
            "encoders" => {
                let mut config: EncoderConfig = read(&part.table)?;
                config.wheels.get_or_insert(if axes[1] { Wheels::Three } else { Wheels::Two });
                Box::new(odometry::WheelEncoders::new(name, config, sim, seed))
            }
            other => return Err(no_sensor(other)),
        };
        sensors.push((part.name.clone(), sensor));
    }
    Ok(Device {
        sensors,
        drive: spec.drive.is_some().then(|| Box::new(motors::Motors::new(Arc::clone(&simulation))) as _),
        ground_truth: Some(Box::new(ground_truth::GroundTruth::new(config.truth_period_ms, simulation))),
        walls,
    })
}

fn start_pose(start: &Start, seed: u64) -> Pose2 {
    let mut rng = crate::random::stream(seed, "start");
    let (aside, turn): (f64, f64) = (rng.random_range(-1.0..=1.0), rng.random_range(-1.0..=1.0));
    let heading = (start.heading_deg + turn * start.jitter_deg).to_radians();
    let (sin, cos) = start.heading_deg.to_radians().sin_cos();
    let aside = aside * start.jitter_m;
    Pose2::new(start.x_m - sin * aside, start.y_m + cos * aside, heading)
}

fn info<M: Message>(name: &str, period_ms: f64, latency_ms: f64, kind: SensorKind) -> SensorInfo {
    SensorInfo {
        name: name.to_owned(),
        message: MessageType::of::<M>().name,
        period_s: period_ms * 1e-3,
        latency_s: latency_ms * 1e-3,
        kind,
    }
}

fn locked<'a>(
    simulation: &'a Mutex<Simulation>,
    name: &str,
) -> Result<MutexGuard<'a, Simulation>, DeviceError> {
    simulation.lock().map_err(|_| DeviceError::failed(name, "another part of the simulator panicked"))
}

/// Schedule of a sensor: measurements at a constant rate from the start of the run, each delivered after a latency.
#[derive(Clone, Copy, Debug)]
struct Schedule {
    period_ns: u64,
    latency_ns: u64,
    next: u64,
}

impl Schedule {
    fn new(period_ms: f64, latency_ms: f64) -> Self {
        let ns = |ms: f64| Time::from_secs_f64(ms * 1e-3).0;
        Self { period_ns: ns(period_ms).max(1), latency_ns: ns(latency_ms), next: 0 }
    }

    /// Returns the delivery time of the next measurement.
    fn next(&self, origin: Time) -> Time {
        Time(origin.0 + self.next * self.period_ns + self.latency_ns)
    }

    /// Returns the sequence number and capture time of the oldest measurement that is due, and advances past it.
    fn oldest(&mut self, origin: Time, now: Time) -> Option<(u64, Time)> {
        if self.next(origin) > now {
            return None;
        }
        let number = self.next;
        self.next += 1;
        Some((number, Time(origin.0 + number * self.period_ns)))
    }

    /// Returns the sequence number and capture time of the newest measurement that is due, and advances past all.
    fn newest(&mut self, origin: Time, now: Time) -> Option<(u64, Time)> {
        let behind = now.0.checked_sub(self.next(origin).0)?;
        self.next += behind / self.period_ns;
        self.oldest(origin, now)
    }
}
