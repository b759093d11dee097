//! Names of the topics.

/// Motor commands.
pub const COMMAND: &str = "command";
/// Decisions of the arbiter, with a verdict for each behavior.
pub const DECISION: &str = "decision";
/// Requests of operators to the running robot.
pub const CONTROL: &str = "control";
/// Goal that an operator set last.
pub const GOAL: &str = "goal";
/// Ground truth of a simulator, for evaluation only.
pub const TRUTH: &str = "truth";
/// Time of each step, if the clock belongs to a driver.
pub const CLOCK: &str = "clock";
/// Announcements of the phases of each step, by the arbiter.
pub const STEP_ANNOUNCEMENTS: &str = "clock/turns";
/// Acknowledgments of the phases, by the behaviors.
pub const STEP_ACKNOWLEDGMENTS: &str = "clock/taken";

/// Heartbeats of plugins.
pub const HEARTBEATS: &str = "plugins/heartbeats";
/// Statistics of the calls of behaviors.
pub const CALLS: &str = "plugins/calls";
/// Saved states of behaviors, for their next instance.
pub const SAVED_STATES: &str = "plugins/memories";
/// Failures of plugins.
pub const FAILURES: &str = "plugins/failures";
/// Walls of simulated worlds, for plots.
pub const WALLS: &str = "plugins/walls";

/// States of the plugins' processes.
pub const PROCESSES: &str = "plugins/processes";
/// Manifest of the robot: its plugins and topics.
pub const MANIFEST: &str = "roster";
/// Requests to change the parameters of behaviors.
pub const RETUNE: &str = "plugins/retune";
/// Replies to these requests.
pub const RETUNED: &str = "plugins/retuned";
/// Commands of a manual control stick.
pub const STICK: &str = "stick";

/// Log of what the arbiter heard before each decision.
pub const HEARD: &str = "replay/arbiter";

/// Returns the topic of the log of the calls of the behavior `name`.
pub fn calls_of(name: &str) -> String {
    format!("replay/behaviors/{name}")
}

/// Returns the topic of the sensor `name`.
pub fn sensor(name: &str) -> String {
    format!("sensors/{name}")
}

/// Returns the topic of the proposals of the behavior `name`.
pub fn proposal(name: &str) -> String {
    format!("behaviors/{name}/proposal")
}

/// Returns the topic of the overlays of the behavior `name`.
pub fn overlay(name: &str) -> String {
    format!("behaviors/{name}/overlay")
}

/// Returns the topic of an output of the behavior `name`.
pub fn output(name: &str, output: &str) -> String {
    format!("behaviors/{name}/{output}")
}
