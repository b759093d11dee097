//! Test bench of the avoider: a robot in the rendered hallway, with generated pose, frames and sonar scans.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{
    Beam, FrameHeader, NO_ECHO, Odometry, PathHeader, PathPoint, Pose, PoseStatus, Proposal, RangeScanHeader,
};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_sim::random::stream;
use yamabico_sim::world::BoxItem;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_stationary_obstacle_avoider::{
    CAMERA, ODOMETRY, PATH, POSE, PassageAvoider, SONAR, StationaryObstacleAvoider,
};

/// Parameters of the avoider, with the map and the thresholds of the hallway.
pub const TABLE: &str =
    "method = \"passages\"\nmap = \"maps/hallway.toml\"\nthresholds = \"maps/hallway-thresholds.toml\"";

/// Camera and mount of the robot in hallway.toml.
pub fn camera() -> (Intrinsics, Mount) {
    (Intrinsics::from_horizontal_fov(256, 240, 60_f64.to_radians()), Mount::tilted(0.6, 6_f64.to_radians()))
}

/// Setup of the robot with a camera.
pub fn setup(intrinsics: Intrinsics) -> Setup {
    Setup {
        robot: Robot { radius_m: 0.2, ..Robot::default() },
        folder: std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs"),
        ..camera_setup(intrinsics, camera().1)
    }
}

/// Renders the hallway, empty or with a white box at `at_m` (m, map frame).
pub fn render(robot: Pose2, at_m: Option<[f64; 2]>) -> Vec<u8> {
    let text = include_str!("../../../../configs/worlds/hallway.toml");
    let mut world = World::from_toml(text).expect("a world");
    world.people.clear();
    world.boxes = at_m.map(|at_m| BoxItem { at_m, ..BoxItem::default() }).into_iter().collect();
    let scene = Scene::new(&world, 1).expect("a scene");
    let (intrinsics, mount) = camera();
    let mut pixels = vec![0; (intrinsics.width * intrinsics.height) as usize];
    Renderer::new(Photometry::default(), stream(3, "picture"))
        .render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
        .expect("a view");
    pixels
}

/// Inputs of one tick.
#[derive(Clone, Debug)]
pub struct Situation {
    pub seconds: f64,
    pub robot: Pose2,
    pub status: PoseStatus,
    /// Range of all beams, m; `None` for no echo.
    pub range_m: Option<f64>,
    pub has_scan: bool,
    pub exposure: f64,
}

impl Default for Situation {
    fn default() -> Self {
        let robot = Pose2::new(3.0, 0.0, 0.0);
        Self {
            seconds: 0.0,
            robot,
            status: PoseStatus::Tracking,
            range_m: None,
            has_scan: true,
            exposure: 1.0,
        }
    }
}

/// Feeds all inputs with the current time as stamp, and returns the proposal.
#[allow(dead_code, reason = "each test uses its part")]
pub fn tick(
    bench: &mut Bench<StationaryObstacleAvoider>,
    situation: &Situation,
    pixels: Option<&[u8]>,
) -> Proposal {
    feed(bench, situation, pixels);
    bench.propose()
}

/// Feeds all inputs with the current time as stamp.
pub fn feed(bench: &mut Bench<StationaryObstacleAvoider>, situation: &Situation, pixels: Option<&[u8]>) {
    let stamp_ns = Time::from_secs_f64(situation.seconds).0;
    bench.at(situation.seconds);
    let robot = situation.robot;
    bench.feed(&ODOMETRY, &Odometry::new(stamp_ns, &robot, &Twist::ZERO), &[]);
    if let Some(pixels) = pixels {
        let header = FrameHeader { exposure: situation.exposure, ..FrameHeader::gray(256, 240, stamp_ns) };
        bench.feed(&CAMERA, &header, pixels);
    }
    if situation.has_scan {
        feed_sonar(bench, stamp_ns, situation.range_m);
    }
    bench.feed(&POSE, &pose(situation), &[]);
    let path = PathHeader {
        stamp_ns,
        evidence_ns: stamp_ns,
        lateral_error_m: robot.y,
        heading_error_rad: robot.theta,
        progress_m: robot.x,
        ..PathHeader::default()
    };
    bench.feed(&PATH, &path, &[PathPoint { x: 0.0, y: 0.0 }, PathPoint { x: 12.5, y: 0.0 }]);
}

/// Pose estimate, with a standard deviation of 1 cm and 1 mrad.
pub fn pose(situation: &Situation) -> Pose {
    let (stamp_ns, robot) = (Time::from_secs_f64(situation.seconds).0, situation.robot);
    let mut covariance = [0.0; 9];
    (covariance[0], covariance[4], covariance[8]) = (1e-4, 1e-4, 1e-6);
    Pose {
        stamp_ns,
        evidence_ns: stamp_ns,
        x: robot.x,
        y: robot.y,
        theta: robot.theta,
        covariance,
        status: situation.status.code(),
        ..Pose::default()
    }
}

/// Feeds a sonar scan of three beams.
pub fn feed_sonar(bench: &mut Bench<StationaryObstacleAvoider>, stamp_ns: u64, range_m: Option<f64>) {
    let header = RangeScanHeader { stamp_ns, min_m: 0.05, max_m: 3.0, ..RangeScanHeader::default() };
    bench.feed(&SONAR, &header, &[0.35, 0.0, -0.35].map(|azimuth_rad| beam(azimuth_rad, range_m)));
}

/// Feeds a sonar scan with the time `seconds` as stamp.
pub fn feed_beams(bench: &mut Bench<StationaryObstacleAvoider>, seconds: f64, beams: &[Beam]) {
    let stamp_ns = Time::from_secs_f64(seconds).0;
    let header = RangeScanHeader { stamp_ns, min_m: 0.05, max_m: 3.0, ..RangeScanHeader::default() };
    bench.feed(&SONAR, &header, beams);
}

/// Beam of a sonar at the front of the robot; `None` for no echo.
pub fn beam(azimuth_rad: f64, range_m: Option<f64>) -> Beam {
    Beam {
        azimuth_rad,
        cone_rad: 0.43,
        range_m: range_m.unwrap_or(3.0),
        x_m: 0.2,
        flags: if range_m.is_some() { 0 } else { NO_ECHO },
        ..Beam::default()
    }
}

/// The avoider with method `passages` of a bench.
pub fn passages(bench: &Bench<StationaryObstacleAvoider>) -> &PassageAvoider {
    bench.behavior.passages().expect("method `passages`")
}
