//! A small field with cubes: robots with both kinds of drive cross it without contact, by the floor that a mirror camera observes.

use std::path::PathBuf;

use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tee;

use crate::support::run_seed;

const WORLD: &str = yamabico_rigs::field::FIELD;

const ROBOT: &str = r#"
name = "field-NAME"
footprint = { radius_m = 0.08 }

[limits]
max_linear_mps = 0.6
max_angular_radps = 3.0
linear_acceleration_mps2 = 0.3
linear_deceleration_mps2 = 0.3
angular_acceleration_radps2 = 8.0
angular_deceleration_radps2 = 8.0
angular_emergency_radps2 = 10.0
linear_jerk_mps3 = 20
angular_jerk_radps3 = 200

[devices.sim]
driver = "sim"
world = "world.toml"
start = { x_m = -1.1, y_m = 0.0, heading_deg = 0, jitter_m = 0.2, jitter_deg = 10 }
body_height_m = 0.25

[sensors.around]
device = "sim"
kind = "mirror-camera"
period_ms = 40
latency_ms = 20
encoding = "rgb8"
picture = { width = 256, height = 220, blind_radius_px = 22, rim_radius_px = 112 }
mirror = { kind = "hyperboloidal", focal_px = 479.374593, eccentricity = 1.26518485, foci_m = 0.0400837 }
mount = { z_m = 0.165 }

[sensors.wheels]
device = "sim"
kind = "encoders"
period_ms = 20

[drive]
device = "sim"
kind = "DRIVE"
"#;

const TASK: &str = r#"
robot = "robot.toml"

[run]
duration_s = 40
goal = { x_m = 1.05, y_m = 0.0, tolerance_m = 0.35 }

[arbiter]
rate_hz = 50

[behaviors.free-space-avoider]
priority = 10
inputs = { camera = "around", odometry = "wheels" }
method = "polar-cells"
speed_mps = 0.4
turn_radps = 2.0
margin_m = 0.03
goal_m = [2.15, 0.0]
tolerance_m = 0.15
"#;

fn cross(drive: &str) {
    let name = format!("{drive}-{}", std::process::id());
    let folder: PathBuf = std::env::temp_dir().join(format!("yamabico-field-{name}"));
    std::fs::create_dir_all(&folder).unwrap();
    let robot = ROBOT.replace("NAME", &name).replace("DRIVE", drive);
    for (file, text) in [("world.toml", WORLD), ("robot.toml", robot.as_str()), ("task.toml", TASK)] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    let task =
        load(&folder.join("task.toml"), &Overrides::default(), &plugins()).unwrap_or_else(|e| panic!("{e}"));
    for seed in 1..=6 {
        let result = run_seed(&task, seed, &mut Tee::default());
        let summary = &result.summary;
        println!("{drive}, seed {seed}: {:?} {summary:?}", result.end);
        assert_eq!((result.end, summary.contacts), (RunEnd::Arrived, Some(0)), "{drive}, seed {seed}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_holonomic_robot_crosses_the_field() {
    cross("holonomic");
}

#[test]
fn a_differential_robot_crosses_the_field() {
    cross("differential");
}
