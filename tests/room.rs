//! A room with a map of its vertical edges: by their azimuths alone the robot reaches its goal around a cupboard that is not on the map,
//! with a mast that sways and wheels that slip.
//!
//! `YAMABICO_SEEDS=50` runs 50 seeds instead of 2.

use nalgebra::{Matrix3, Point2, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Obstacle, ObstaclesHeader, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{RunEnd, topics};
use yamabico_runtime::record::Tap;
use yamabico_sim::Scene;

use crate::support::{run_seed, task};

/// Distance from the center of the room within which only the cupboard stands, m.
const CENTER_M: f64 = 1.0;

/// Records ground truth and poses, and the latest obstacles with their stamp.
#[derive(Default)]
struct PoseTap {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
    obstacles: (u64, Vec<Obstacle>),
}

impl Tap for PoseTap {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.truth.push((truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)));
        } else if topic == topics::output("map-localizer", "pose") {
            self.poses.push(*bytemuck::from_bytes(header));
        } else if topic == topics::output("map-localizer", "obstacles") {
            let header: &ObstaclesHeader = bytemuck::from_bytes(header);
            self.obstacles = (header.stamp_ns, bytemuck::pod_collect_to_vec(items));
        }
    }
}

/// Errors of one run.
#[derive(Default)]
struct RunErrors {
    /// Position errors while tracking, m.
    position_m: Vec<f64>,
    /// Normalized estimation errors squared: 3 on average if the covariance is right.
    nees: Vec<f64>,
    /// Position error at the end, m.
    goal_m: f64,
    /// Distance of each published edge from the nearest corner of the cupboard, m.
    edges_m: Vec<f64>,
}

impl PoseTap {
    fn errors(&self, corners: &[[f64; 2]]) -> RunErrors {
        let mut errors = RunErrors::default();
        for pose in self.poses.iter().filter(|pose| pose.status() == Some(PoseStatus::Tracking)) {
            let Ok(at) = self.truth.binary_search_by_key(&pose.stamp_ns, |(stamp, _)| *stamp) else {
                continue;
            };
            let truth = self.truth[at].1;
            let turn = angle_difference(pose.theta, truth.theta);
            let error = Vector3::new(pose.x - truth.x, pose.y - truth.y, turn);
            errors.goal_m = error.xy().norm();
            errors.position_m.push(errors.goal_m);
            let covariance = Matrix3::from_row_slice(&pose.covariance);
            errors.nees.push(error.dot(&(covariance.try_inverse().unwrap() * error)));
        }
        let (stamp_ns, obstacles) = &self.obstacles;
        if let Some(seen_from) = self.poses.iter().rfind(|pose| pose.stamp_ns == *stamp_ns) {
            let map_from_robot = Pose2::new(seen_from.x, seen_from.y, seen_from.theta);
            let nearest = |edge: &Obstacle| {
                let at = map_from_robot.transform_point(Point2::new(edge.x, edge.y));
                let distances = corners.iter().map(|&corner| (at - Point2::from(corner)).norm());
                distances.fold(f64::INFINITY, f64::min)
            };
            errors.edges_m = obstacles.iter().map(nearest).collect();
        }
        errors
    }
}

fn corners(seed: u64) -> Vec<[f64; 2]> {
    let world = yamabico_rigs::camera::world("room");
    let plan = Scene::new(&world, seed).unwrap().floor_plan();
    plan.into_iter().flatten().filter(|[x, y]| x.abs().max(y.abs()) < CENTER_M).collect()
}

fn drive(task: &Task, seed: u64) -> (RunEnd, Option<u64>, RunErrors) {
    let mut tap = PoseTap::default();
    let result = run_seed(task, seed, &mut tap);
    (result.end, result.summary.contacts.map(u64::from), tap.errors(&corners(seed)))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn max(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[test]
fn the_robot_drives_around_an_obstacle_that_is_not_on_the_map() {
    let task = task("room", &[]);
    let seeds = std::env::var("YAMABICO_SEEDS").map_or(2, |text| text.parse().unwrap());
    let (mut positions, mut nees, mut goals, mut edges) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=seeds {
        let (end, contacts, errors) = drive(&task, seed);
        println!(
            "seed {seed}: {end:?}, {contacts:?} contacts, position {:.1} mm mean, {:.1} max, {:.1} at the goal, {} edges {:.1} mm",
            1e3 * mean(&errors.position_m),
            1e3 * max(&errors.position_m),
            1e3 * errors.goal_m,
            errors.edges_m.len(),
            1e3 * mean(&errors.edges_m)
        );
        assert_eq!((end, contacts), (RunEnd::Arrived, Some(0)), "seed {seed}");
        positions.extend(errors.position_m);
        nees.extend(errors.nees);
        goals.push(errors.goal_m);
        edges.extend(errors.edges_m);
    }
    println!(
        "{seeds} seeds: position {:.1} mm mean, {:.1} max; at the goal {:.1} max; NEES {:.2}; {} edges of the \
         cupboard {:.1} mm mean, {:.1} max",
        1e3 * mean(&positions),
        1e3 * max(&positions),
        1e3 * max(&goals),
        mean(&nees),
        edges.len(),
        1e3 * mean(&edges),
        1e3 * max(&edges)
    );
    assert!(mean(&positions) <= 0.015 && max(&positions) <= 0.05 && max(&goals) <= 0.02);
    assert!(mean(&edges) <= 0.03, "{}", mean(&edges));
}
