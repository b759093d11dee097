//! In a room whose edges are known a robot goes to its goal by the azimuths of these edges alone, around a cupboard that the
//! map does not tell of, with a mast that sways and wheels that slip.
//!
//! `YAMABICO_SEEDS=50` runs so many seeds instead of 2.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Vector3};
use yamabico::plugins::plugins;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Obstacle, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::{End, topics};
use yamabico_runtime::record::{Tap, Tee};
use yamabico_runtime::run::{Options, run};
use yamabico_sim::{Scene, World};

/// Within this of the middle of the room only the cupboard stands, m.
const MIDDLE_M: f64 = 1.0;

/// Keeps truths and poses, and the obstacles told last.
#[derive(Default)]
struct Judge {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
    obstacles: Vec<Obstacle>,
}

impl Tap for Judge {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.truth.push((truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)));
        } else if topic == topics::output("map-localizer", "pose") {
            self.poses.push(*bytemuck::from_bytes(header));
        } else if topic == topics::output("map-localizer", "obstacles") {
            self.obstacles = bytemuck::pod_collect_to_vec(items);
        }
    }
}

/// What one run gave.
#[derive(Default)]
struct Course {
    /// Errors of the place while tracking, m.
    errors_m: Vec<f64>,
    /// Squared errors in units of their covariance: 3 on average where that is honest.
    nees: Vec<f64>,
    goal_m: f64,
    /// From each edge that was told to the nearest corner of the cupboard, m.
    edges_m: Vec<f64>,
}

impl Judge {
    fn course(&self, corners: &[[f64; 2]]) -> Course {
        let mut course = Course::default();
        for pose in self.poses.iter().filter(|pose| pose.status() == Some(PoseStatus::Tracking)) {
            let Ok(at) = self.truth.binary_search_by_key(&pose.stamp_ns, |(stamp, _)| *stamp) else {
                continue;
            };
            let truth = self.truth[at].1;
            let turn = angle_difference(pose.theta, truth.theta);
            let error = Vector3::new(pose.x - truth.x, pose.y - truth.y, turn);
            course.goal_m = error.xy().norm();
            course.errors_m.push(course.goal_m);
            let covariance = Matrix3::from_row_slice(&pose.covariance);
            course.nees.push(error.dot(&(covariance.try_inverse().unwrap() * error)));
        }
        let distance = |edge: &Obstacle, [x, y]: &[f64; 2]| (edge.x - x).hypot(edge.y - y);
        let nearest =
            |edge| corners.iter().map(|corner| distance(edge, corner)).fold(f64::INFINITY, f64::min);
        course.edges_m = self.obstacles.iter().map(nearest).collect();
        course
    }
}

fn corners(seed: u64) -> Vec<[f64; 2]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/worlds/room.toml");
    let world = World::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap();
    let plan = Scene::new(&world, seed).unwrap().floor_plan();
    plan.into_iter().flatten().filter(|[x, y]| x.abs().max(y.abs()) < MIDDLE_M).collect()
}

fn drive(task: &Task, seed: u64) -> (End, Option<u64>, Course) {
    let mut judge = Judge::default();
    let mut tee = Tee(vec![&mut judge]);
    let options = Options { seed, ..Options::default() };
    let ran = run(task, &options, &AtomicBool::new(false), &mut tee, &mut |_| {}).unwrap();
    (ran.end, ran.summary.contacts.map(u64::from), judge.course(&corners(seed)))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn most(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[test]
fn the_robot_goes_around_what_the_map_does_not_tell_of() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/room.toml");
    let task = load(&path, &Overrides::default(), &plugins()).unwrap_or_else(|problems| panic!("{problems}"));
    let seeds = std::env::var("YAMABICO_SEEDS").map_or(2, |text| text.parse().unwrap());
    let (mut errors, mut nees, mut goals, mut edges) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=seeds {
        let (end, contacts, course) = drive(&task, seed);
        println!(
            "seed {seed}: {end:?}, {contacts:?} contacts, place {:.1} mm on average, {:.1} at most, {:.1} at the goal, {} edges {:.1} mm",
            1e3 * mean(&course.errors_m),
            1e3 * most(&course.errors_m),
            1e3 * course.goal_m,
            course.edges_m.len(),
            1e3 * mean(&course.edges_m)
        );
        assert_eq!((end, contacts), (End::Arrived, Some(0)), "seed {seed}");
        errors.extend(course.errors_m);
        nees.extend(course.nees);
        goals.push(course.goal_m);
        edges.extend(course.edges_m);
    }
    println!(
        "{seeds} seeds: place {:.1} mm on average, {:.1} at most; at the goal {:.1} at most; NEES {:.2}; {} edges of the \
         cupboard {:.1} mm on average, {:.1} at most",
        1e3 * mean(&errors),
        1e3 * most(&errors),
        1e3 * most(&goals),
        mean(&nees),
        edges.len(),
        1e3 * mean(&edges),
        1e3 * most(&edges)
    );
    assert!(mean(&errors) <= 0.015 && most(&errors) <= 0.05 && most(&goals) <= 0.02);
    assert!(mean(&edges) <= 0.03, "{}", mean(&edges));
}
