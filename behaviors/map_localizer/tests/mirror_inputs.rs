//! What a mirror camera shows that is not as it should be ends in a named state, and never in confident nonsense.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "rig/mirror.rs"]
mod mirror;

use mirror::{MirrorRobot, keys};
use nalgebra::{Matrix3, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{Pose, PoseStatus, Reason};
use yamabico_core::testing::{Bench, CountingAllocator, allocations};
use yamabico_map_localizer::MapLocalizer;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;

/// Where the robot stands on the field and in the room.
const PLACES: [(&str, Pose2); 2] =
    [("field", Pose2 { x: -0.3, y: -0.1, theta: 0.4 }), ("room", Pose2 { x: -0.9, y: -0.6, theta: 0.8 })];

/// Ten pictures of one place, each changed, to a robot that believes itself 2 cm aside: how it ends.
fn look(name: &str, truth: Pose2, change: impl Fn(&mut [u8])) -> (PoseStatus, Reason, Pose) {
    let mut robot = MirrorRobot::new(name);
    let believed = Pose2::new(truth.x + 0.02, truth.y - 0.01, truth.theta + 0.01);
    let mut bench = Bench::<MapLocalizer>::new(&keys(name, &believed), robot.setup.clone()).unwrap();
    let mut pose = None;
    for i in 1..=10_u64 {
        let mut pixels = robot.see(truth, 1);
        change(&mut pixels);
        robot.show(&mut bench, 0.1 * i as f64, &pixels);
        bench.propose();
        pose = bench.published::<Pose>("pose").pop().map(|(pose, _)| pose);
    }
    let (status, reason) = bench.behavior.status();
    (status, reason, pose.unwrap())
}

/// Squared error in units of its covariance, three degrees of freedom.
fn surprise(pose: &Pose, truth: &Pose2) -> f64 {
    let turn = angle_difference(pose.theta, truth.theta);
    let error = Vector3::new(pose.x - truth.x, pose.y - truth.y, turn);
    error.dot(&(Matrix3::from_row_slice(&pose.covariance).try_inverse().unwrap() * error))
}

#[test]
fn good_pictures_are_tracked() {
    for (name, truth) in PLACES {
        let (status, reason, pose) = look(name, truth, |_| {});
        assert_eq!((status, reason), (PoseStatus::Tracking, Reason::Nominal), "{name}");
        assert!((pose.x - truth.x).hypot(pose.y - truth.y) < 0.015, "{name}: {pose:?}");
        assert!(surprise(&pose, &truth) < 16.3, "{name}");
    }
}

#[test]
fn nothing_to_see_is_told() {
    for (name, truth) in PLACES {
        for level in [0, 128, 255] {
            let (status, reason, pose) = look(name, truth, |pixels| pixels.fill(level));
            assert_ne!(status, PoseStatus::Tracking, "{name}, {level}");
            assert!(matches!(reason, Reason::TooFewSegments), "{name}, {level}: {reason:?}");
            assert!(surprise(&pose, &truth) < 16.3, "{name}, {level}");
        }
    }
}

#[test]
fn a_lamp_of_another_color_makes_no_floor() {
    let (name, truth) = PLACES[0];
    let (status, reason, pose) = look(name, truth, |pixels| {
        pixels.as_chunks_mut::<3>().0.iter_mut().for_each(|[_, green, blue]| {
            *green /= 2;
            *blue /= 3;
        });
    });
    assert_ne!(status, PoseStatus::Tracking);
    assert_ne!(reason, Reason::Nominal);
    assert!(surprise(&pose, &truth) < 16.3);
}

#[test]
fn half_a_ring_is_told_or_still_right() {
    for (name, truth) in PLACES {
        let (status, reason, pose) = look(name, truth, |pixels| {
            let half = pixels.len() / 2;
            pixels[..half].fill(0);
        });
        assert!(surprise(&pose, &truth) < 16.3, "{name}: {status:?}, {reason:?}, {pose:?}");
    }
}

#[test]
fn a_mirror_beside_its_place_or_leaning_is_no_confident_nonsense() {
    for (name, truth) in PLACES {
        let mut robot = MirrorRobot::new(name);
        // The picture five pixels aside.
        let channels = if name == "field" { 3 } else { 1 };
        let (status, reason, pose) = look(name, truth, |pixels| pixels.rotate_right(5 * channels));
        let is_told = status != PoseStatus::Tracking || reason != Reason::Nominal;
        let off = (pose.x - truth.x).hypot(pose.y - truth.y);
        assert!(is_told || off < 0.06, "{name}, aside: {status:?}, {off} m");
        // Two degrees of lean.
        let lean = 2_f64.to_radians();
        robot.mount.tilt = lean;
        let mut bench = Bench::<MapLocalizer>::new(&keys(name, &truth), robot.setup.clone()).unwrap();
        let pixels = robot.see(truth, 1);
        for i in 1..=10 {
            robot.show(&mut bench, 0.1 * f64::from(i), &pixels);
            bench.propose();
        }
        let (status, reason) = bench.behavior.status();
        let is_told = status != PoseStatus::Tracking || reason != Reason::Nominal;
        let off = bench.behavior.belief().unwrap().pose.distance(&truth);
        assert!(is_told || off < 0.06, "{name}, leaning: {status:?}, {reason:?}, {off} m");
    }
}

#[test]
fn a_picture_of_another_size_is_malformed() {
    let (name, truth) = PLACES[1];
    let robot = MirrorRobot::new(name);
    let mut bench = Bench::<MapLocalizer>::new(&keys(name, &truth), robot.setup.clone()).unwrap();
    robot.show(&mut bench, 0.1, &[0; 100]);
    bench.propose();
    assert_eq!(bench.behavior.status().1, Reason::MalformedInput);
}

#[test]
fn what_a_method_lacks_is_named() {
    let robot = MirrorRobot::new("room");
    let refused = |toml: &str| {
        Bench::<MapLocalizer>::new(toml, robot.setup.clone()).err().map(|error| error.to_string())
    };
    assert!(refused("method = \"azimuth\"").unwrap().contains("edge_map"));
    assert!(refused("method = \"floor-outline\"").unwrap().contains("floor_plan"));
    assert!(refused("map = \"maps/hallway.toml\"").unwrap().contains("needs a pinhole camera"));
}

#[test]
fn a_picture_allocates_nothing_after_warm_up() {
    for (name, truth) in PLACES {
        let mut robot = MirrorRobot::new(name);
        let pictures: Vec<_> = (0..3).map(|_| robot.see(truth, 1)).collect();
        let mut bench = Bench::<MapLocalizer>::new(&keys(name, &truth), robot.setup.clone()).unwrap();
        for i in 1..=80_u32 {
            robot.show(&mut bench, 0.1 * f64::from(i), &pictures[i as usize % 3]);
            let (_, asked) = allocations(|| bench.propose());
            if i > 40 {
                assert_eq!(asked.calls, 0, "{name}, call {i}");
            }
        }
        assert_eq!(bench.behavior.status().0, PoseStatus::Tracking, "{name}");
    }
}
