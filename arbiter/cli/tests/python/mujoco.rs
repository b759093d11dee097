//! The hallway in MuJoCo. The tests that simulate need an interpreter with the packages of `sensors/mujoco/requirements.txt`, named by
//! the variable `YAMABICO_MUJOCO`; without it they are skipped with a message.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use yamabico_core::message::Command as MotorCommand;
use yamabico_live_robot::robot::LiveRobot;
use yamabico_live_robot::venv;

use super::{worlds, yamabico};
use crate::program::{assert_exit, binary, text};

/// Number of plugins of the task without a map: four behaviors and the simulator.
const PLUGINS: usize = 5;
/// Simulated time of a run, which includes the first box.
const SIMULATED: Duration = Duration::from_secs(8);

/// Returns an interpreter that can simulate.
fn interpreter() -> Option<PathBuf> {
    let named = std::env::var_os("YAMABICO_MUJOCO").map(PathBuf::from);
    if named.is_none() {
        eprintln!(
            "skipped, YAMABICO_MUJOCO names no Python interpreter with MuJoCo: sensors/mujoco/README.md"
        );
    }
    named
}

fn task(name: &str) -> String {
    yamabico_testkit::config(name).to_str().unwrap().to_owned()
}

#[test]
fn the_unit_tests_of_the_hallway_pass() {
    let Some(python) = interpreter() else { return };
    let folder = yamabico_testkit::workspace().join("sensors/mujoco");
    let mut tests = Command::new(python);
    let tests =
        tests.args(["-m", "unittest", "discover", "-s", "tests"]).current_dir(folder).output().unwrap();
    assert_exit(&tests, 0, &["OK"]);
    assert!(!text(&tests).contains("skipped"), "{}", text(&tests));
}

#[test]
fn check_accepts_both_tasks() {
    let Some(python) = interpreter() else { return };
    for name in ["mujoco-hall.toml", "mujoco-hall-unmapped.toml"] {
        assert_exit(&yamabico(&python, &["check", &task(name)]), 0, &["no errors", "mujoco/device.py"]);
    }
}

#[test]
fn check_names_the_packages_that_are_missing() {
    // This environment has the package of this repository alone.
    let Some(python) = venv::interpreter(binary()) else { return };
    let checked = yamabico(&python, &["check", &task("mujoco-hall.toml")]);
    assert_exit(&checked, 2, &["mujoco, cv2", "pip install", "sensors/mujoco/requirements.txt"]);
}

#[test]
fn the_same_seed_gives_the_same_commands() {
    let Some(python) = interpreter() else { return };
    let [first, second, other] = [(1, "linoleum"), (2, "linoleum"), (3, "tile")].map(|(run, floor)| {
        let robot = start(&python, &format!("mujoco-{run}-{}", std::process::id()), floor);
        worlds::first_commands(robot, SIMULATED)
    });
    assert!(first.last().unwrap().stamp_ns > 7_000_000_000, "{} commands", first.len());
    assert!(first.iter().any(|command| command.twist.linear > 0.2), "it drives");
    assert_eq!(bytes(&first), bytes(&second));
    assert_ne!(bytes(&first), bytes(&other), "the floor is seen");
}

/// Bytes of the commands after time zero, whose command is published before the test subscribes.
fn bytes(commands: &[MotorCommand]) -> Vec<u8> {
    let steps = commands.iter().filter(|command| command.stamp_ns > 0);
    steps.flat_map(|command| bytemuck::bytes_of(command).to_vec()).collect()
}

fn start(python: &Path, name: &str, floor: &str) -> LiveRobot {
    let device = yamabico_testkit::workspace().join("sensors/mujoco/device.py").canonicalize().unwrap();
    let mut set = vec![
        format!("robot.devices.hall.exec=[\"{}\", \"{}\"]", python.display(), device.display()),
        "robot.devices.hall.deadline_ms=60000".to_owned(),
        format!("robot.devices.hall.floor=\"{floor}\""),
    ];
    // A busy machine must not look like a hanging plugin.
    for behavior in ["sonar-halt", "stuck-recovery", "stationary-obstacle-avoider", "wall-follower"] {
        set.push(format!("behaviors.{behavior}.deadline_ms=60000"));
    }
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    LiveRobot::start(binary(), &task("mujoco-hall-unmapped.toml"), name, PLUGINS, &set)
}
