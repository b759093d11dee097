//! Robots in a world that a Python program simulates on its own clock.

use std::path::Path;
use std::time::Duration;

use yamabico_core::message::Command;

use yamabico_live_robot::robot::LiveRobot;

/// Number of plugins: the behaviors and the simulator.
const PLUGINS: usize = 3;
const TIMEOUT: Duration = Duration::from_secs(600);

/// Starts a robot in the simulated world at `pace` times real time; its wall follower is a Python program, too.
pub fn start(program: &Path, python: &Path, name: &str, pace: f64, more: &[&str]) -> LiveRobot {
    let exec = |module: &str| format!("[\"{}\", \"-m\", \"yamabico.examples.{module}\"]", python.display());
    let set = [
        format!("robot.devices.world.exec={}", exec("flat_world")),
        format!("robot.devices.world.pace={pace:?}"),
        format!("behaviors.wall-follower.exec={}", exec("wall_follower")),
        "behaviors.wall-follower.inputs={ camera = \"front\" }".to_owned(),
        "run.goal.y_m=15".to_owned(),
        "run.duration_s=100000".to_owned(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).chain(more.iter().copied()).collect();
    LiveRobot::start(
        program,
        yamabico_testkit::config("flat-world.toml").to_str().expect("a name"),
        name,
        PLUGINS,
        &set,
    )
}

/// The commands of the first `simulated` time of such a run.
pub fn commands(program: &Path, python: &Path, name: &str, pace: f64, simulated: Duration) -> Vec<Command> {
    // A busy machine must not look like a hanging plugin.
    let patient = ["robot.devices.world.deadline_ms=60000", "behaviors.wall-follower.deadline_ms=60000"];
    first_commands(start(program, python, name, pace, &patient), simulated)
}

/// The commands of the first `simulated` time of a run, which it ends.
pub fn first_commands(mut robot: LiveRobot, simulated: Duration) -> Vec<Command> {
    let end = simulated.as_nanos() as u64;
    let is_there = |robot: &LiveRobot| robot.commands.last().is_some_and(|command| command.stamp_ns > end);
    assert!(robot.wait_until(TIMEOUT, is_there), "the simulator does not advance");
    let commands = robot.commands.iter().copied().filter(|command| command.stamp_ns <= end).collect();
    robot.interrupt();
    commands
}
