//! Invalid images of a mirror camera result in a reported status, never in a confident wrong pose.

use nalgebra::{Matrix3, Vector3};
use yamabico_core::geometry::{Hypotenuse, Pose2, angle_difference};
use yamabico_core::message::{Goal, Odometry, PathHeader, Pose, PoseStatus, Reason};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_map_localizer::{GOAL, MapLocalizer, ODOMETRY};
use yamabico_rigs::mirror_robot::{MirrorRobot, localizer_parameters};

/// Pose of the robot on the field and in the room.
const POSES: [(&str, Pose2); 2] =
    [("field", Pose2 { x: -0.3, y: -0.1, theta: 0.4 }), ("room", Pose2 { x: -0.9, y: -0.6, theta: 0.8 })];

/// Feeds ten modified images from one pose to a robot with an initial error of 2 cm; returns the final status, reason
/// and pose.
fn localize(name: &str, truth: Pose2, change: impl Fn(&mut [u8])) -> (PoseStatus, Reason, Pose) {
    let mut robot = MirrorRobot::new(name);
    let start = Pose2::new(truth.x + 0.02, truth.y - 0.01, truth.theta + 0.01);
    let mut bench =
        Bench::<MapLocalizer>::new(&localizer_parameters(name, &start), robot.setup.clone()).unwrap();
    let mut pose = None;
    for i in 1..=10_u64 {
        let mut pixels = robot.render(truth, 1);
        change(&mut pixels);
        robot.feed(&mut bench, 0.1 * i as f64, &pixels);
        bench.propose();
        pose = bench.published::<Pose>("pose").pop().map(|(pose, _)| pose);
    }
    let (status, reason) = bench.behavior.status();
    (status, reason, pose.unwrap())
}

/// Returns the normalized estimation error squared (NEES), three degrees of freedom.
fn nees(pose: &Pose, truth: &Pose2) -> f64 {
    let turn = angle_difference(pose.theta, truth.theta);
    let error = Vector3::new(pose.x - truth.x, pose.y - truth.y, turn);
    error.dot(&(Matrix3::from_row_slice(&pose.covariance).try_inverse().unwrap() * error))
}

#[test]
fn valid_images_are_tracked() {
    for (name, truth) in POSES {
        let (status, reason, pose) = localize(name, truth, |_| {});
        assert_eq!((status, reason), (PoseStatus::Tracking, Reason::Nominal), "{name}");
        assert!((pose.x - truth.x).hypotenuse(pose.y - truth.y) < 0.015, "{name}: {pose:?}");
        assert!(nees(&pose, &truth) < 16.3, "{name}");
    }
}

#[test]
fn blank_images_are_reported() {
    for (name, truth) in POSES {
        for level in [0, 128, 255] {
            let (status, reason, pose) = localize(name, truth, |pixels| pixels.fill(level));
            assert_ne!(status, PoseStatus::Tracking, "{name}, {level}");
            assert!(matches!(reason, Reason::TooFewSegments), "{name}, {level}: {reason:?}");
            assert!(nees(&pose, &truth) < 16.3, "{name}, {level}");
        }
    }
}

#[test]
fn a_floor_in_colored_light_is_not_recognized() {
    let (name, truth) = POSES[0];
    let (status, reason, pose) = localize(name, truth, |pixels| {
        pixels.as_chunks_mut::<3>().0.iter_mut().for_each(|[_, green, blue]| {
            *green /= 2;
            *blue /= 3;
        });
    });
    assert_ne!(status, PoseStatus::Tracking);
    assert_ne!(reason, Reason::Nominal);
    assert!(nees(&pose, &truth) < 16.3);
}

#[test]
fn half_an_image_is_consistent() {
    for (name, truth) in POSES {
        let (status, reason, pose) = localize(name, truth, |pixels| {
            let half = pixels.len() / 2;
            pixels[..half].fill(0);
        });
        assert!(nees(&pose, &truth) < 16.3, "{name}: {status:?}, {reason:?}, {pose:?}");
    }
}

#[test]
fn a_displaced_or_tilted_mirror_is_reported_or_accurate() {
    for (name, truth) in POSES {
        let mut robot = MirrorRobot::new(name);
        // Image shifted by five pixels.
        let channels = if name == "field" { 3 } else { 1 };
        let (status, reason, pose) = localize(name, truth, |pixels| pixels.rotate_right(5 * channels));
        let is_reported = status != PoseStatus::Tracking || reason != Reason::Nominal;
        let off = (pose.x - truth.x).hypotenuse(pose.y - truth.y);
        assert!(is_reported || off < 0.06, "{name}, shifted: {status:?}, {off} m");
        robot.mount.tilt = 2_f64.to_radians();
        let mut bench =
            Bench::<MapLocalizer>::new(&localizer_parameters(name, &truth), robot.setup.clone()).unwrap();
        let pixels = robot.render(truth, 1);
        for i in 1..=10 {
            robot.feed(&mut bench, 0.1 * f64::from(i), &pixels);
            bench.propose();
        }
        let (status, reason) = bench.behavior.status();
        let is_reported = status != PoseStatus::Tracking || reason != Reason::Nominal;
        let off = bench.behavior.belief().unwrap().pose.distance(&truth);
        assert!(is_reported || off < 0.06, "{name}, tilted: {status:?}, {reason:?}, {off} m");
    }
}

#[test]
fn an_image_of_another_size_is_malformed() {
    let (name, truth) = POSES[1];
    let robot = MirrorRobot::new(name);
    let mut bench =
        Bench::<MapLocalizer>::new(&localizer_parameters(name, &truth), robot.setup.clone()).unwrap();
    robot.feed(&mut bench, 0.1, &[0; 100]);
    bench.propose();
    assert_eq!(bench.behavior.status().1, Reason::MalformedInput);
}

#[test]
fn a_missing_file_is_named() {
    let robot = MirrorRobot::new("room");
    let refused = |toml: &str| {
        Bench::<MapLocalizer>::new(toml, robot.setup.clone()).err().map(|error| error.to_string())
    };
    assert!(refused("method = \"azimuth\"").unwrap().contains("edge_map"));
    assert!(refused("method = \"floor-outline\"").unwrap().contains("floor_plan"));
    assert!(refused("map = \"maps/hallway.toml\"").unwrap().contains("must be a pinhole camera"));
}

#[test]
fn an_image_allocates_nothing_after_warm_up() {
    for (name, truth) in POSES {
        let mut robot = MirrorRobot::new(name);
        let images: Vec<_> = (0..3).map(|_| robot.render(truth, 1)).collect();
        let mut bench =
            Bench::<MapLocalizer>::new(&localizer_parameters(name, &truth), robot.setup.clone()).unwrap();
        for i in 1..=80_u32 {
            robot.feed(&mut bench, 0.1 * f64::from(i), &images[i as usize % 3]);
            let (_, made) = allocations(|| bench.propose());
            if i > 40 {
                assert_eq!(made.calls, 0, "{name}, call {i}");
            }
        }
        assert_eq!(bench.behavior.status().0, PoseStatus::Tracking, "{name}");
    }
}

/// Returns a bench at 2 s whose pose is lost after a meter forth and back, to the pose in the room.
fn lost_in_the_room(robot: &MirrorRobot) -> Bench<MapLocalizer> {
    let truth = POSES[1].1;
    let parameters =
        localizer_parameters("room", &truth).replace("sigma_m = 0.05, sigma_deg = 3", "sigma_m = 0.51");
    let mut bench = Bench::<MapLocalizer>::new(&parameters, robot.setup.clone()).unwrap();
    for tick in 0..=100 {
        let x = 0.02 * f64::from(50 - (50_i32 - tick).abs());
        let stamp_ns = Time::from_secs_f64(0.02 * f64::from(tick)).0;
        bench.at(0.02 * f64::from(tick));
        bench.feed(&ODOMETRY, &Odometry { stamp_ns, x, ..Odometry::default() }, &[]).propose();
    }
    assert_eq!(bench.behavior.status().0, PoseStatus::Lost);
    bench
}

#[test]
fn a_goal_set_while_lost_is_planned_from_where_the_robot_is_found() {
    let mut robot = MirrorRobot::new("room");
    let truth = POSES[1].1;
    let moved = Pose2::new(truth.x + 0.15, truth.y - 0.1, truth.theta);
    let pixels = robot.render(moved, 1);
    let mut bench = lost_in_the_room(&robot);
    bench.feed(&GOAL, &Goal { x: -1.3, y: 1.3, theta: f64::NAN, ..Goal::default() }, &[]).propose();
    robot.feed(&mut bench, 2.1, &pixels);
    bench.propose();
    let (_, path) = bench.published::<PathHeader>("path").pop().unwrap();
    let off = (path[0].x - moved.x).hypotenuse(path[0].y - moved.y);
    assert!(off < 0.05, "{off} m");
}

#[test]
fn a_place_without_map_edges_in_view_is_no_contradiction() {
    let mut robot = MirrorRobot::new("room");
    let pixels = robot.render(POSES[1].1, 1);
    let far = Pose2::new(100.0, 0.0, 0.0);
    let mut bench =
        Bench::<MapLocalizer>::new(&localizer_parameters("room", &far), robot.setup.clone()).unwrap();
    for i in 1..=20 {
        robot.feed(&mut bench, 0.1 * f64::from(i), &pixels);
        bench.propose();
    }
    assert_eq!(bench.behavior.status(), (PoseStatus::Unknown, Reason::NoModel));
}

#[test]
fn the_image_after_the_one_that_found_the_pose_is_correlated_with_it() {
    let mut robot = MirrorRobot::new("room");
    let pixels = robot.render(POSES[1].1, 1);
    let mut bench = lost_in_the_room(&robot);
    let mut variance = |seconds: f64| {
        robot.feed(&mut bench, seconds, &pixels);
        bench.propose();
        assert_eq!(bench.behavior.status().0, PoseStatus::Tracking);
        bench.published::<Pose>("pose")[0].0.covariance[0]
    };
    let (found, next) = (variance(2.1), variance(2.2));
    assert!(next > 0.3 * found, "{found} m², then {next} m²");
}
