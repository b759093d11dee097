//! Obstacles that are not on the map, from the images of a mirror camera in a room with a cupboard.

use nalgebra::Point2;
use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_core::message::{Encoding, FrameHeader, Obstacle, ObstaclesHeader, Odometry, PoseStatus};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_rigs::mirror_robot::{MirrorRobot, localizer_parameters};
use yamabico_sim::Scene;

/// Pose at which the robot of these tests begins, map frame.
const START: Pose2 = Pose2 { x: -1.3, y: -1.1, theta: 0.3 };
/// Distance that it drives with an image every 2 cm, m.
const DRIVEN_M: f64 = 0.8;
/// Distance from the center of the room within which only the cupboard stands, m.
const CENTER_M: f64 = 1.0;

/// A robot that has driven past the cupboard and stands.
struct Passed {
    bench: Bench<MapLocalizer>,
    robot: MirrorRobot,
    /// Image from its place.
    pixels: Vec<u8>,
    now_s: f64,
}

impl Passed {
    fn new() -> Self {
        let robot = MirrorRobot::new("room");
        let parameters = localizer_parameters("room", &START);
        let bench = Bench::new(&parameters, robot.setup.clone()).unwrap();
        let mut passed = Self { bench, robot, pixels: Vec::new(), now_s: 0.0 };
        for image in 0..=40 {
            let driven_m = 0.02 * f64::from(image);
            passed.now_s += 0.1;
            passed.pixels = passed.robot.render(pose(driven_m), 1);
            passed.feed_odometry(driven_m);
            passed.feed_image(passed.now_s);
            passed.bench.propose();
        }
        passed
    }

    fn feed_odometry(&mut self, driven_m: f64) {
        let stamp_ns = Time::from_secs_f64(self.now_s).0;
        let odometry = Odometry { stamp_ns, x: driven_m, ..Odometry::default() };
        self.bench.at(self.now_s).feed(&ODOMETRY, &odometry, &[]);
    }

    fn feed_image(&mut self, captured_s: f64) {
        let [width, height] = self.robot.camera.image().size();
        let (stamp_ns, encoding) = (Time::from_secs_f64(captured_s).0, Encoding::Gray8.code());
        let header =
            FrameHeader { stamp_ns, width, height, stride: width, encoding, ..FrameHeader::default() };
        self.bench.feed(&CAMERA, &header, &self.pixels);
    }

    /// Returns the obstacles published by a call with the next image.
    fn see(&mut self) -> Option<(ObstaclesHeader, Vec<Obstacle>)> {
        self.now_s += 0.1;
        self.feed_odometry(DRIVEN_M);
        self.feed_image(self.now_s - 0.05);
        self.bench.propose();
        self.bench.published::<ObstaclesHeader>("obstacles").pop()
    }
}

/// Returns the true pose after a distance.
fn pose(driven_m: f64) -> Pose2 {
    START.compose(&Pose2::new(driven_m, 0.0, 0.0))
}

#[test]
fn obstacles_are_in_the_robot_frame_at_the_newest_odometry() {
    let mut passed = Passed::new();
    let (header, obstacles) = passed.see().unwrap();
    let stamps = [header.stamp_ns, header.evidence_ns];
    assert_eq!(stamps, [passed.now_s, passed.now_s - 0.05].map(|seconds| Time::from_secs_f64(seconds).0));
    let plan = Scene::new(&passed.robot.world, 1).unwrap().floor_plan();
    let corners: Vec<_> = plan
        .into_iter()
        .flatten()
        .filter(|[x, y]| x.abs().max(y.abs()) < CENTER_M)
        .map(|[x, y]| pose(DRIVEN_M).inverse().transform_point(Point2::new(x, y)))
        .collect();
    assert!(!obstacles.is_empty() && !corners.is_empty());
    for seen in obstacles {
        let distances = corners.iter().map(|corner| (corner.x - seen.x).hypotenuse(corner.y - seen.y));
        let off_m = distances.fold(f64::INFINITY, f64::min);
        assert!(off_m < 0.1, "{off_m} m from {corners:?}: {seen:?}");
        // Its distance is less certain than its direction.
        let [xx, xy, yx, yy] = seen.covariance;
        let along = seen.x * (xx * seen.x + xy * seen.y) + seen.y * (yx * seen.x + yy * seen.y);
        let across = seen.y * (xx * seen.y - xy * seen.x) - seen.x * (yx * seen.y - yy * seen.x);
        assert!(along > 2.0 * across, "{seen:?}");
    }
}

#[test]
fn an_image_without_a_fix_shows_no_obstacles() {
    let mut passed = Passed::new();
    assert!(passed.see().is_some());
    let pixels = passed.pixels.clone();
    passed.pixels.fill(0);
    assert!(passed.see().is_none(), "a blank image");
    passed.pixels.truncate(100);
    assert!(passed.see().is_none(), "a malformed image");
    passed.pixels = pixels;
    assert!(passed.see().is_some());
}

#[test]
fn a_pose_that_is_found_again_has_no_obstacles_yet() {
    let mut passed = Passed::new();
    assert!(passed.see().is_some());
    // Jumps of the odometry make the pose uncertain, until it is lost.
    let mut jumps = 0;
    while passed.bench.behavior.status().0 != PoseStatus::Lost || jumps % 2 == 1 {
        jumps += 1;
        passed.now_s += 0.1;
        passed.feed_odometry(DRIVEN_M + 40.0 * f64::from(jumps % 2));
        passed.bench.propose();
        assert!(jumps < 20);
    }
    for _ in 0..5 {
        assert!(passed.see().is_none(), "located from the pose before");
    }
    assert_eq!(passed.bench.behavior.status().0, PoseStatus::Tracking);
}
