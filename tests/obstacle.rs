//! A box that is not on the map is detected from a distance and passed without contact.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{MessageType, Obstacle, Truth};
use yamabico_core::time::Time;
use yamabico_runtime::execution::topics;
use yamabico_runtime::record::Tap;
use yamabico_sim::Scene;

use crate::support::{run_seed, task};

/// Seeds of the task's box and person.
const SEEDS: [u64; 3] = [304, 305, 306];
/// Distance between the centers of robot and box at which the box must be detected, m.
const MIN_DETECTION_M: f64 = 1.0;
/// Distance of a published obstacle from the center of the box within which it is the box, m.
const SAME_M: f64 = 0.5;

/// Returns the center of the box of a seed, m, from the difference of the floor plans with and without boxes.
fn box_center(seed: u64) -> [f64; 2] {
    let mut world = yamabico_rigs::camera::world("hallway");
    let with = Scene::new(&world, seed).unwrap().floor_plan();
    world.boxes.clear();
    let without = Scene::new(&world, seed).unwrap().floor_plan();
    let corners: Vec<[f64; 2]> = with.into_iter().filter(|side| !without.contains(side)).flatten().collect();
    assert_eq!(corners.len(), 8, "four sides of two corners");
    [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / corners.len() as f64)
}

/// Records the first detection of the box.
struct DetectionTap {
    box_at: [f64; 2],
    robot: Pose2,
    /// Distance to the box at the first detection, m.
    detection_m: Option<f64>,
}

impl Tap for DetectionTap {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.robot = Pose2::new(truth.x, truth.y, truth.theta);
        } else if topic == topics::output("stationary-obstacle-avoider", "obstacles") {
            let box_in_robot = self.robot.inverse().transform_point(self.box_at.into());
            let obstacles: &[Obstacle] = bytemuck::cast_slice(items);
            let distance =
                |obstacle: &Obstacle| (box_in_robot - nalgebra::Point2::new(obstacle.x, obstacle.y)).norm();
            if obstacles.iter().any(|obstacle| distance(obstacle) < SAME_M) {
                self.detection_m.get_or_insert(box_in_robot.coords.norm());
            }
        }
    }
}

#[test]
fn the_box_is_detected_a_meter_away_and_passed_without_contact() {
    let task = task("hallway", &[]);
    for seed in SEEDS {
        let box_at = box_center(seed);
        let mut tap = DetectionTap { box_at, robot: Pose2::IDENTITY, detection_m: None };
        let result = run_seed(&task, seed, &mut tap);
        let detection_m = tap.detection_m.unwrap_or(0.0);
        assert!(detection_m >= MIN_DETECTION_M, "seed {seed}: detected {detection_m:.2} m away");
        assert!(tap.robot.x > box_at[0] + 1.0, "seed {seed}: ended at x = {:.2} m", tap.robot.x);
        assert_eq!(result.summary.contacts, Some(0), "seed {seed}");
    }
}
