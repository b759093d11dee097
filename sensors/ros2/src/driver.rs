//! Driver of robots whose sensors and drive are topics of ROS 2.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use yamabico_core::behavior::ParameterError;
use yamabico_core::drive::Drive;
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Beam, Bumper, FrameHeader, Imu, Message, Odometry, RangeScanHeader};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::range_scan::MAX_BEAMS;
use yamabico_core::sensor::{Sensor, SensorInfo, SensorKind};
use yamabico_recording::ros2::camera_info::{CAMERA_INFO, camera_info};
use yamabico_recording::ros2::transforms::{Frames, TF_MESSAGE};
use yamabico_recording::{Filter, Publication, ros2};

use crate::config::{CameraConfig, DeviceConfig, DriveConfig, RangeConfig, Reliability, TopicConfig};
use crate::drive::TwistDrive;
use crate::names::checked_topic;
use crate::network::{Network, Receiver, Subscription};
use crate::ros_clock::RosClock;
use crate::sensor::{Converter, Inbox, Logged, ScannerMount, TopicSensor, locked};

/// Name of the type of `/clock`.
const CLOCK: &str = "rosgraph_msgs/msg/Clock";
/// Number of waiting measurements of a sensor that is no camera.
const MAX_WAITING: usize = 64;
/// Share by which focal lengths, principal points and sizes of a robot file and of CameraInfo may differ.
const MAX_DIFFERENCE: f64 = 0.01;

/// Returns the driver `ros2`.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    let drive = |kind, summary, axes| DriveOffer::new::<DriveConfig>(kind, summary, axes);
    Arc::new(Ros2Driver {
        info: DriverInfo {
            name: "ros2".into(),
            summary: "Robots whose sensors and drive are topics of ROS 2.".into(),
            parameters: schema_of::<DeviceConfig>(),
            files: Vec::new(),
            sensors: vec![
                SensorOffer::new::<FrameHeader, CameraConfig>("camera", "CompressedImage or Image."),
                SensorOffer::new::<RangeScanHeader, RangeConfig>("range", "LaserScan or Range."),
                SensorOffer::new::<Odometry, TopicConfig>("odometry", "Odometry."),
                SensorOffer::new::<Imu, TopicConfig>("imu", "Imu."),
                SensorOffer::new::<Bumper, TopicConfig>(
                    "bumper",
                    "Bool, HazardDetectionVector of a Create 3, or Bump of a Neato.",
                ),
            ],
            drives: vec![
                drive("twist", "Sends Twist or TwistStamped; zero when commands stop.", Axes::PLANAR),
                drive("holonomic-twist", "The same for a base that also moves sideways.", Axes::ALL),
            ],
        },
    })
}

struct Ros2Driver {
    info: DriverInfo,
}

impl Driver for Ros2Driver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let Settings { rate_hz, latency_ms, kind, max_item_bytes, .. } = settings(sensor)?;
        let info = SensorInfo {
            name: sensor.name.clone(),
            message: self.message_of(sensor),
            period_s: 1.0 / rate_hz,
            latency_s: 1e-3 * latency_ms,
            kind,
        };
        Ok(SensorDescription { info, max_item_bytes })
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        let config: DeviceConfig = read(&spec.table)?;
        let network = Network::join(&config.network())?;
        let clock = Arc::new(Mutex::new(RosClock::default()));
        let frames = Arc::new(Mutex::new(Frames::default()));
        network.subscribe(clock_subscription(&clock));
        network.subscribe(frames_subscription(&frames));
        let sensors = spec.sensors.iter().map(|part| {
            let sensor = self.open_sensor(part, &network, &clock, &frames)?;
            Ok((part.name.clone(), Box::new(sensor) as Box<dyn Sensor>))
        });
        let sensors = sensors.collect::<Result<_, ParameterError>>()?;
        let drive = match spec.drive {
            Some(part) => Some(open_drive(&part, network)?),
            None => None,
        };
        Ok(Device { sensors, drive, ground_truth: None, walls: Vec::new() })
    }
}

impl Ros2Driver {
    fn message_of(&self, part: &PartSpec) -> &'static str {
        self.info.sensor(&part.kind).map_or("", |offer| offer.message.name)
    }

    fn open_sensor(
        &self,
        part: &PartSpec,
        network: &Network,
        clock: &Arc<Mutex<RosClock>>,
        frames: &Arc<Mutex<Frames>>,
    ) -> Result<TopicSensor, ParameterError> {
        let Settings { topic, reliability, filter, has_frame, .. } = settings(part)?;
        let message = self.message_of(part);
        // Only the newest picture counts.
        let inbox = Inbox::new(if message == FrameHeader::NAME { 1 } else { MAX_WAITING });
        let mut converter = Converter {
            name: part.name.clone(),
            topic: topic.clone(),
            inbox: Arc::clone(&inbox),
            clock: Arc::clone(clock),
            mount: if has_frame { ScannerMount::Frames(Arc::clone(frames)) } else { ScannerMount::Known },
            logged: Logged::default(),
        };
        // Joints are not odometry without the geometry of the wheels.
        let types = ros2::types(message).iter().copied().filter(|name| *name != "sensor_msgs/msg/JointState");
        network.subscribe(Subscription {
            topic,
            types: types.collect(),
            reliability,
            transient_local: false,
            needed_by: Some(format!("sensor `{}`", part.name)),
            receive: Box::new(move |message_type, data, arrival| converter.take(message_type, data, arrival)),
            on_link: Box::new(|_| {}),
        });
        if part.kind == "camera" {
            compare_intrinsics(part, network)?;
        }
        Ok(TopicSensor { name: part.name.clone(), inbox, publication: Publication::new(&part.name, filter) })
    }
}

/// Contents of the keys of a sensor.
struct Settings {
    topic: String,
    rate_hz: f64,
    latency_ms: f64,
    reliability: Reliability,
    kind: SensorKind,
    filter: Filter,
    /// True if the pose of a scanner comes from its frame.
    has_frame: bool,
    max_item_bytes: usize,
}

fn settings(part: &PartSpec) -> Result<Settings, ParameterError> {
    match part.kind.as_str() {
        "camera" => {
            let config: CameraConfig = read(&part.table)?;
            let (width, height) = (config.intrinsics.width, config.intrinsics.height);
            Ok(Settings {
                topic: checked_topic("topic", &config.topic)?,
                rate_hz: config.rate_hz,
                latency_ms: config.latency_ms,
                reliability: config.reliability,
                kind: SensorKind::camera(&config.intrinsics, config.mount, config.calibration)?,
                filter: Filter::Size { width, height },
                has_frame: false,
                max_item_bytes: width as usize * height as usize,
            })
        }
        "range" => {
            let config: RangeConfig = read(&part.table)?;
            let (min_m, max_m) = (config.min_m, config.max_m);
            if min_m >= max_m {
                return Err(ParameterError::new("min_m", "must be below max_m"));
            }
            let pose = [config.x_m, config.y_m, config.yaw_deg.map(f64::to_radians)];
            let [x, y, yaw] = pose.map(|number| number.unwrap_or(0.0));
            Ok(Settings {
                topic: checked_topic("topic", &config.topic)?,
                rate_hz: config.rate_hz,
                latency_ms: config.latency_ms,
                reliability: config.reliability,
                kind: SensorKind::Range { min_m, max_m },
                filter: Filter::Mount { mount: Pose2::new(x, y, yaw), min_m, max_m },
                has_frame: pose.iter().all(Option::is_none),
                max_item_bytes: MAX_BEAMS * size_of::<Beam>(),
            })
        }
        _ => {
            let config: TopicConfig = read(&part.table)?;
            Ok(Settings {
                topic: checked_topic("topic", &config.topic)?,
                rate_hz: config.rate_hz,
                latency_ms: config.latency_ms,
                reliability: config.reliability,
                kind: SensorKind::Other,
                filter: Filter::Plain,
                has_frame: false,
                max_item_bytes: 0,
            })
        }
    }
}

fn open_drive(part: &PartSpec, network: Arc<Network>) -> Result<Box<dyn Drive>, ParameterError> {
    let config: DriveConfig = read(&part.table)?;
    let config = DriveConfig { topic: checked_topic("topic", &config.topic)?, ..config };
    let ending = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
        let registered = signal_hook::flag::register(signal, Arc::clone(&ending));
        registered.map_err(|error| ParameterError::new("", format!("cannot handle signals: {error}")))?;
    }
    Ok(Box::new(TwistDrive::new(network, config, ending)))
}

fn clock_subscription(clock: &Arc<Mutex<RosClock>>) -> Subscription {
    let clock = Arc::clone(clock);
    let mut is_told = false;
    let receive: Receiver = Box::new(move |_, data, arrival| {
        if let Ok(ns) = ros2::clock(data) {
            locked(&clock).tick(ns, arrival);
            if !std::mem::replace(&mut is_told, true) {
                tracing::warn!("the other side has a simulated time on /clock; this run stays in real time");
            }
        }
    });
    plain("/clock", CLOCK, false, receive)
}

fn frames_subscription(frames: &Arc<Mutex<Frames>>) -> Subscription {
    let frames = Arc::clone(frames);
    let receive: Receiver = Box::new(move |_, data, _| {
        if let Err(refusal) = locked(&frames).add(data) {
            tracing::warn!("a message on /tf_static is left out: {refusal}");
        }
    });
    plain("/tf_static", TF_MESSAGE, true, receive)
}

fn plain(topic: &str, message_type: &'static str, transient_local: bool, receive: Receiver) -> Subscription {
    Subscription {
        topic: topic.to_owned(),
        types: vec![message_type],
        reliability: Reliability::BestEffort,
        transient_local,
        needed_by: None,
        receive,
        on_link: Box::new(|_| {}),
    }
}

/// Tells when the intrinsics in the robot file differ from those on the topic of the camera.
fn compare_intrinsics(part: &PartSpec, network: &Network) -> Result<(), ParameterError> {
    let config: CameraConfig = read(&part.table)?;
    let Some(topic) = &config.camera_info else { return Ok(()) };
    let topic = checked_topic("camera_info", topic)?;
    let own = config.intrinsics.intrinsics();
    let (name, about) = (part.name.clone(), topic.clone());
    let mut is_done = false;
    let receive: Receiver = Box::new(move |_, data, _| {
        if std::mem::replace(&mut is_done, true) {
            return;
        }
        match camera_info(data) {
            Err(refusal) => tracing::warn!("`{name}`: {about}: {refusal}"),
            Ok(camera) => {
                let of = |i: &yamabico_core::camera::Intrinsics| {
                    [f64::from(i.width), f64::from(i.height), i.fx, i.fy, i.cx, i.cy]
                };
                let pairs = of(&own).into_iter().zip(of(&camera.intrinsics));
                let differs =
                    pairs.into_iter().any(|(a, b)| (a - b).abs() > MAX_DIFFERENCE * b.abs().max(1.0));
                if differs {
                    let i = camera.intrinsics;
                    tracing::warn!(
                        "the intrinsics of `{name}` differ from {about}: set intrinsics = {{ width = {}, height = {}, fx = {:.2}, \
                         fy = {:.2}, cx = {:.2}, cy = {:.2} }}",
                        i.width,
                        i.height,
                        i.fx,
                        i.fy,
                        i.cx,
                        i.cy
                    );
                }
            }
        }
    });
    let mut subscription = plain(&topic, CAMERA_INFO, false, receive);
    subscription.needed_by = Some(format!("sensor `{}`", part.name));
    network.subscribe(subscription);
    Ok(())
}
