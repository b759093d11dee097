//! What each channel is called.

/// Motor commands.
pub const COMMAND: &str = "command";
/// Decisions with their verdicts.
pub const DECISION: &str = "decision";
/// Requests to the running robot.
pub const CONTROL: &str = "control";
/// Where the operator last sent the robot.
pub const GOAL: &str = "goal";
/// A simulator's truth, for judging only.
pub const TRUTH: &str = "truth";
/// The instants of a run whose clock is a driver's.
pub const CLOCK: &str = "clock";
/// The turns of each of its steps, as the arbiter calls them.
pub const TURNS: &str = "clock/turns";
/// Who has taken which turn.
pub const TAKEN: &str = "clock/taken";

/// Which plugins are alive.
pub const HEARTBEATS: &str = "plugins/heartbeats";
/// How the calls of behaviors went.
pub const CALLS: &str = "plugins/calls";
/// What the successors of behaviors must know.
pub const MEMORIES: &str = "plugins/memories";
/// What went wrong in plugins.
pub const FAILURES: &str = "plugins/failures";
/// Walls that devices know, for plots.
pub const WALLS: &str = "plugins/walls";

/// The processes of plugins.
pub const PROCESSES: &str = "plugins/processes";
/// Who works on the robot, and every topic.
pub const ROSTER: &str = "roster";
/// Behaviors are asked to change their parameters.
pub const RETUNE: &str = "plugins/retune";
/// What became of it.
pub const RETUNED: &str = "plugins/retuned";
/// Where somebody holds the stick.
pub const STICK: &str = "stick";

/// What the sensor `name` measures.
pub fn sensor(name: &str) -> String {
    format!("sensors/{name}")
}

/// What the behavior `name` proposes.
pub fn proposal(name: &str) -> String {
    format!("behaviors/{name}/proposal")
}

/// What the behavior `name` publishes on `output`.
pub fn output(name: &str, output: &str) -> String {
    format!("behaviors/{name}/{output}")
}
