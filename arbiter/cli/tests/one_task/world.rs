//! The corridor of the task, as cameras, lidars and wheels of played devices meet it: the simulator on a thread, in real time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, PartSpec};
use yamabico_core::geometry::Twist;
use yamabico_core::message::{Command, FrameHeader, RangeScanHeader, Truth};
use yamabico_core::sensor::{MotionLimits, Robot};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_played_devices::picture_server::NewestPicture;
use yamabico_testkit::configs;

/// Period of the simulation.
const PERIOD: Duration = Duration::from_millis(20);
/// Names of its sensors.
const CAMERA: &str = "camera";
const LIDAR: &str = "lidar";

/// Measurements for devices, and the truth.
#[derive(Clone, Debug)]
pub struct Sensed {
    /// Ranges by azimuth, rad, positive to the left, and range, m.
    pub ranges: Vec<(f64, f64)>,
    /// True position along and across the corridor, m, and heading, rad.
    pub pose: [f64; 3],
    /// Least distance from an obstacle so far, m.
    pub clearance_m: f64,
}

impl Default for Sensed {
    fn default() -> Self {
        Sensed { ranges: Vec::new(), pose: [0.0; 3], clearance_m: f64::INFINITY }
    }
}

/// The corridor with a robot in it.
pub struct World {
    /// Newest picture of the camera.
    pub picture: NewestPicture,
    sensed: Arc<Mutex<Sensed>>,
    /// Speed and turn rate of the base in each period, m/s and rad/s.
    driven: Arc<Mutex<Vec<[f64; 2]>>>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl World {
    /// Starts it with a camera with these keys, and a base that moves with the speed and turn rate that `base` returns.
    pub fn start(
        camera: &str,
        mut base: impl FnMut(&Sensed, &NewestPicture) -> [f64; 2] + Send + 'static,
    ) -> World {
        let device = open(camera);
        let picture = NewestPicture::default();
        let sensed = Arc::new(Mutex::new(Sensed::default()));
        let driven = Arc::new(Mutex::new(Vec::new()));
        let is_over = Arc::new(AtomicBool::new(false));
        let (of_picture, of_sensed) = (Arc::clone(&picture), Arc::clone(&sensed));
        let (of_driven, over) = (Arc::clone(&driven), Arc::clone(&is_over));
        let run = move || {
            let mut device = device;
            let (begun, mut steps) = (Instant::now(), 0);
            while !over.load(Ordering::Relaxed) {
                let now = Time::from_secs_f64(begun.elapsed().as_secs_f64());
                let mut seen = of_sensed.lock().unwrap().clone();
                let [speed, turn_rate] = base(&seen, &of_picture);
                of_driven.lock().unwrap().push([speed, turn_rate]);
                step(&mut device, Twist::planar(speed, turn_rate), now, &of_picture, &mut seen);
                *of_sensed.lock().unwrap() = seen;
                steps += 1;
                std::thread::sleep(
                    (PERIOD * steps).saturating_sub(begun.elapsed()).max(Duration::from_millis(1)),
                );
            }
        };
        World { picture, sensed, driven, is_over, thread: Some(std::thread::spawn(run)) }
    }

    /// The present measurements.
    pub fn sensed(&self) -> MutexGuard<'_, Sensed> {
        self.sensed.lock().unwrap()
    }

    /// Speed and turn rate of the base in each period so far, m/s and rad/s.
    pub fn driven(&self) -> Vec<[f64; 2]> {
        self.driven.lock().unwrap().clone()
    }

    /// Returns a function that measures the range at an azimuth in degrees, positive to the left, m; 0 without an echo.
    pub fn ranger(&self) -> impl FnMut(f64) -> f64 + Send + 'static {
        let sensed = Arc::clone(&self.sensed);
        move |azimuth_deg| {
            let azimuth_rad = azimuth_deg.to_radians();
            let off = |of: &f64| (of - azimuth_rad).sin().atan2((of - azimuth_rad).cos()).abs();
            let sensed = sensed.lock().unwrap();
            let nearest = sensed.ranges.iter().min_by(|(a, _), (b, _)| off(a).total_cmp(&off(b)));
            nearest.filter(|(_, range_m)| range_m.is_finite()).map_or(0.0, |(_, range_m)| *range_m)
        }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn open(camera: &str) -> Device {
    let part = |name: &str, kind: &str, keys: &str| PartSpec {
        name: name.into(),
        kind: kind.into(),
        table: toml::from_str(keys).unwrap(),
    };
    let table = "world = \"worlds/corridor.toml\"\nstart = { x_m = 0.0, y_m = 0.2, heading_deg = 5 }";
    let limits = MotionLimits { speed: [1.0, 0.0, 3.0], ..MotionLimits::default() };
    let spec = DeviceSpec {
        name: "world".into(),
        table: toml::from_str(table).unwrap(),
        sensors: vec![
            part(CAMERA, "camera", camera),
            part(LIDAR, "lidar", "beams = 360\nlatency_ms = 0\ndropout = 0.0"),
        ],
        drive: Some(part("drive", "differential", "")),
        folder: configs(),
        seed: 1,
        robot: Robot { radius_m: 0.15, limits, ..Robot::default() },
    };
    yamabico_sim::driver().open(spec).map_err(|error| error.to_string()).unwrap()
}

fn step(device: &mut Device, twist: Twist, now: Time, picture: &NewestPicture, sensed: &mut Sensed) {
    let mut published = Published::default();
    let command = Command { stamp_ns: now.0, twist, ..Command::default() };
    device.drive.as_mut().unwrap().apply(Some(&command), now).unwrap();
    let sensors = device.sensors.iter_mut().map(|(_, sensor)| sensor);
    for sensor in sensors.chain(&mut device.ground_truth) {
        sensor.poll(now, &mut Outputs::new(&mut published)).unwrap();
    }
    if let Some((frame, pixels)) = published.of::<FrameHeader>(CAMERA).pop() {
        let gray = image::GrayImage::from_raw(frame.width, frame.height, pixels).unwrap();
        let mut jpeg = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 85).encode_image(&gray).unwrap();
        let mut newest = picture.lock().unwrap();
        *newest = (newest.0 + 1, jpeg);
    }
    if let Some((_, beams)) = published.of::<RangeScanHeader>(LIDAR).pop() {
        let range = |beam: &yamabico_core::message::Beam| beam.echo_m().unwrap_or(f64::INFINITY);
        sensed.ranges = beams.iter().map(|beam| (beam.azimuth_rad, range(beam))).collect();
    }
    if let Some((truth, _)) = published.of::<Truth>("truth").pop() {
        sensed.pose = [truth.x, truth.y, truth.theta];
        sensed.clearance_m = sensed.clearance_m.min(truth.clearance_m);
    }
}
