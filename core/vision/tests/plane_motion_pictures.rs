//! Plane motion on rendered pictures: floor, mirror images, a box, a walker.

use crate::rendered_floor::{Scene, camera};
use nalgebra::Point2;
use yamabico_core::testing::{Allocations, allocations};
use yamabico_geometry::Pose2;
use yamabico_geometry::image::ImageView;
use yamabico_vision::plane_motion::sequential_test::PointClass;
use yamabico_vision::plane_motion::{NotJudged, PlaneMotion};

const WIDTH: u32 = 256;
const HEIGHT: u32 = 240;
/// Way and time from one picture to the next.
const STEP_M: f64 = 0.05;
const STEP_S: f64 = 0.125;

/// A drive straight ahead, whose odometry turns by `slip` (rad) too much in each step.
struct Drive {
    motion: PlaneMotion,
    robot: Pose2,
    odometry: Pose2,
    slip: f64,
    pictures: u64,
}

impl Drive {
    fn new(slip: f64) -> Self {
        let (intrinsics, mount) = camera(WIDTH, HEIGHT);
        let motion = PlaneMotion::new(intrinsics, mount);
        Self { motion, robot: Pose2::IDENTITY, odometry: Pose2::IDENTITY, slip, pictures: 0 }
    }

    fn advance(&mut self) {
        self.robot = self.robot * Pose2::new(STEP_M, 0.0, 0.0);
        self.odometry = self.odometry * Pose2::new(STEP_M, 0.0, self.slip);
        self.pictures += 1;
    }

    fn look(&mut self, scene: &Scene) -> Result<(), NotJudged> {
        let data = scene.render(WIDTH, HEIGHT, &self.robot, self.pictures);
        let image = ImageView::new(&data, WIDTH as usize, HEIGHT as usize, WIDTH as usize).unwrap();
        self.motion.look(image, self.odometry, self.pictures as f64 * STEP_S).map(|_| ())
    }

    /// Drives `count` steps, and looks after each; returns the points of each class: floor, above, below.
    fn run(&mut self, scene: &Scene, count: usize) -> [usize; 3] {
        let mut classes = [0; 3];
        for _ in 0..count {
            self.advance();
            if self.look(scene).is_ok() {
                for (count, class) in
                    classes.iter_mut().zip([PointClass::Floor, PointClass::Above, PointClass::Below])
                {
                    *count += self.motion.points().iter().filter(|point| point.class == class).count();
                }
            }
        }
        classes
    }

    /// Nearest thing in the robot's way: distance and lateral offset, m.
    fn thing_ahead(&mut self) -> Option<Point2<f64>> {
        let odometry = self.odometry;
        let feet = self.motion.obstacles(&odometry, |_| true).iter();
        feet.map(|thing| odometry.inverse().transform_point(thing.foot))
            .find(|foot| foot.x > 0.35 && foot.y.abs() < 0.4)
    }
}

#[test]
fn the_joints_of_tiles_are_floor_though_the_wheels_slip() {
    let scene = Scene { has_joints: true, ..Scene::default() };
    let mut drive = Drive::new(0.05_f64.to_radians());
    let [floor, above, below] = drive.run(&scene, 24);
    assert!(floor > 1000, "{floor} points of the floor");
    assert!(above * 50 < floor && below * 20 < floor, "{floor} on, {above} above, {below} below");
    assert_eq!(drive.thing_ahead(), None);
    let alignment = drive.motion.alignment().unwrap();
    let way = alignment.motion.x;
    assert!((0.48..0.56).contains(&way), "the longest baseline is {way} m");
    // The wheels err by half a degree over this way.
    assert!(alignment.motion.theta.abs() < 0.15_f64.to_radians(), "{} rad", alignment.motion.theta);
    assert!(alignment.inliers * 10 > alignment.pixels * 7, "{alignment:?}");
}

#[test]
fn a_box_is_a_thing_where_it_stands() {
    let scene = Scene { thing: Some((Point2::new(3.2, 0.05), 0.24)), has_joints: true, ..Scene::default() };
    let mut drive = Drive::new(0.0);
    drive.run(&scene, 24);
    // Now it is 2 m ahead.
    let foot = drive.thing_ahead().expect("the box is found");
    assert!((foot.x - 2.0).abs() < 0.4 && (foot.y - 0.05).abs() < 0.2, "{foot}");
    drive.run(&scene, 12);
    let foot = drive.thing_ahead().expect("the box is still there");
    // Its near edge is reported rather too near.
    assert!((-0.45..0.2).contains(&(foot.x - 1.4)) && (foot.y - 0.05).abs() < 0.2, "{foot}");
    let odometry = drive.odometry;
    let things = drive.motion.obstacles(&odometry, |_| true);
    let thing = things.iter().max_by(|a, b| a.peak.total_cmp(&b.peak)).unwrap();
    assert!(thing.peak > 2.0 && thing.half_width_m < 0.5, "{thing:?}");
    assert!(thing.covariance[(0, 0)] > 0.0 && thing.covariance.determinant() > 0.0);
}

#[test]
fn lamps_in_a_mirroring_floor_are_below_it() {
    let scene = Scene { mirror: 0.15, has_joints: true, ..Scene::default() };
    let mut drive = Drive::new(0.0);
    let [floor, above, below] = drive.run(&scene, 24);
    assert!(below > 30, "{below} points of mirror images");
    assert!(floor > 400 && above * 10 < floor + below, "{floor} on, {above} above, {below} below");
    assert_eq!(drive.thing_ahead(), None);
}

#[test]
fn a_standing_robot_adds_nothing() {
    let scene = Scene { has_joints: true, ..Scene::default() };
    let mut drive = Drive::new(0.0);
    assert_eq!(drive.look(&scene), Err(NotJudged::NoBaseline));
    drive.run(&scene, 14);
    let ahead = drive.odometry.transform_point(Point2::new(1.0, 0.0));
    let before = drive.motion.grid().log_odds(ahead);
    assert!(before < -0.5, "{before}");
    for _ in 0..5 {
        drive.pictures += 1;
        assert_eq!(drive.look(&scene), Err(NotJudged::Standstill));
    }
    let after = drive.motion.grid().log_odds(ahead);
    assert!(after <= 0.0 && after > before - 1e-6, "{before} to {after}");
}

#[test]
fn a_walker_fits_no_static_place() {
    let mut drive = Drive::new(0.0);
    let mut unfit = 0;
    for i in 0..30 {
        drive.advance();
        let y = -0.9 + 0.09 * f64::from(i);
        let scene = Scene { thing: Some((Point2::new(3.4, y), 0.3)), ..Scene::default() };
        if drive.look(&scene).is_ok() && (12..26).contains(&i) {
            unfit += drive.motion.points().iter().filter(|p| p.class == PointClass::Moving).count();
        }
    }
    assert!(unfit > 100, "{unfit} points fit nothing");
}

#[test]
fn pictures_after_the_first_ones_do_not_allocate() {
    let scene = Scene { has_joints: true, ..Scene::default() };
    let mut drive = Drive::new(0.0);
    drive.run(&scene, 14);
    let views: Vec<_> = (1..4)
        .map(|i| {
            let robot = drive.robot * Pose2::new(STEP_M * f64::from(i), 0.0, 0.0);
            (robot, scene.render(WIDTH, HEIGHT, &robot, i as u64))
        })
        .collect();
    let (judged, asked) = allocations(|| {
        let mut judged = 0;
        for (i, (robot, data)) in views.iter().enumerate() {
            let image = ImageView::new(data, WIDTH as usize, HEIGHT as usize, WIDTH as usize).unwrap();
            judged += usize::from(drive.motion.look(image, *robot, 2.0 + i as f64).is_ok());
            drive.motion.obstacles(robot, |_| true);
        }
        judged
    });
    assert_eq!(judged, 3);
    assert_eq!(asked, Allocations::default(), "allocations in three pictures");
}
