//! A box that the map does not have is found before the robot is near, and passed without contact.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{MessageType, Obstacle, Truth};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::topics;
use yamabico_runtime::record::{Tap, Tee};
use yamabico_runtime::run::{Options, run};
use yamabico_sim::{Scene, World};

/// Seeds of the task's box and person.
const SEEDS: [u64; 3] = [304, 305, 306];
/// The box is known before the robot's middle is nearer to the box's, meters.
const FOUND_M: f64 = 1.0;
/// An obstacle that is told within this of the box is the box, meters.
const SAME_M: f64 = 0.5;

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs")
}

/// The middle of the box of a seed, meters: of what stands on the floor there and not where the world has no boxes.
fn middle_of_box(seed: u64) -> [f64; 2] {
    let text = std::fs::read_to_string(configs().join("worlds/hallway.toml")).unwrap();
    let mut world = World::from_toml(&text).unwrap();
    let with = Scene::new(&world, seed).unwrap().floor_plan();
    world.boxes.clear();
    let without = Scene::new(&world, seed).unwrap().floor_plan();
    let corners: Vec<[f64; 2]> = with.into_iter().filter(|side| !without.contains(side)).flatten().collect();
    assert_eq!(corners.len(), 8, "four sides of two corners");
    [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / corners.len() as f64)
}

struct Judge {
    box_at: [f64; 2],
    robot: Pose2,
    /// Distance to the box when it was told first, meters.
    found_m: Option<f64>,
}

impl Tap for Judge {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.robot = Pose2::new(truth.x, truth.y, truth.theta);
        } else if topic == topics::output("stationary-obstacle-avoider", "obstacles") {
            let box_in_robot = self.robot.inverse().transform_point(self.box_at.into());
            let told: &[Obstacle] = bytemuck::cast_slice(items);
            let is_told = told
                .iter()
                .any(|told| (box_in_robot - nalgebra::Point2::new(told.x, told.y)).norm() < SAME_M);
            if is_told {
                self.found_m.get_or_insert(box_in_robot.coords.norm());
            }
        }
    }
}

#[test]
fn the_box_is_found_a_meter_away_and_passed_without_contact() {
    let task = load(&configs().join("hallway.toml"), &Overrides::default(), &plugins())
        .unwrap_or_else(|problems| panic!("{problems}"));
    for seed in SEEDS {
        let box_at = middle_of_box(seed);
        let mut judge = Judge { box_at, robot: Pose2::IDENTITY, found_m: None };
        let options = Options { seed, ..Options::default() };
        let mut tee = Tee(vec![&mut judge]);
        let ran = run(&task, &options, &AtomicBool::new(false), &mut tee, &mut |_| {}).unwrap();
        let found_m = judge.found_m.unwrap_or(0.0);
        assert!(found_m >= FOUND_M, "seed {seed}: found {found_m:.2} m away");
        assert!(judge.robot.x > box_at[0] + 1.0, "seed {seed}: it ended at {:.2} m", judge.robot.x);
        assert_eq!(ran.summary.contacts, Some(0), "seed {seed}");
    }
}
