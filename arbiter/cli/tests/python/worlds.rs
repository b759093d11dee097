//! Robots in a world that a program in Python simulates, by its own clock.

use std::path::Path;
use std::time::Duration;

use yamabico_core::message::Command;

use crate::robot::{Robot, config};

/// Behaviors and the world.
const PLUGINS: usize = 3;
const LONGEST: Duration = Duration::from_secs(600);

/// A robot in the world of lines, at so many times real time, which follows walls in Python.
pub fn start(program: &Path, python: &Path, name: &str, pace: f64, more: &[&str]) -> Robot {
    let exec = |module: &str| format!("[\"{}\", \"-m\", \"yamabico.examples.{module}\"]", python.display());
    let set = [
        format!("robot.devices.world.exec={}", exec("flat_world")),
        format!("robot.devices.world.pace={pace:?}"),
        format!("behaviors.wall-follower.exec={}", exec("wall_follower")),
        "behaviors.wall-follower.inputs={ camera = \"front\" }".to_owned(),
        "run.goal.x_m=1000".to_owned(),
        "run.duration_s=100000".to_owned(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).chain(more.iter().copied()).collect();
    Robot::start(program, config("flat-world.toml").to_str().expect("a name"), name, PLUGINS, &set)
}

/// The commands of the first `simulated` of such a run.
pub fn commands(program: &Path, python: &Path, name: &str, pace: f64, simulated: Duration) -> Vec<Command> {
    // Nobody hangs, whatever else the machine has to do.
    let patient = ["robot.devices.world.deadline_ms=60000", "behaviors.wall-follower.deadline_ms=60000"];
    let mut robot = start(program, python, name, pace, &patient);
    let end = simulated.as_nanos() as u64;
    let is_there = |robot: &Robot| robot.told.last().is_some_and(|command| command.stamp_ns > end);
    assert!(robot.watch_until(LONGEST, is_there), "the world does not go on");
    let told = robot.told.iter().copied().filter(|command| command.stamp_ns <= end).collect();
    robot.interrupt();
    told
}
