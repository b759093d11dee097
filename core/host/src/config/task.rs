//! A checked task file.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use super::robot::RobotFile;
use super::tables::{Isolation, Policy};
use crate::Scheduling;
use yamabico_core::behavior::{Behavior, BehaviorFactory, BuildError, Setup};

/// What a task file and its robot file say together. Nothing in it is unchecked.
#[derive(Clone, Debug)]
pub struct Task {
    /// Where it was read from.
    pub path: PathBuf,
    /// The file's name without folder and ending.
    pub name: String,
    /// The robot that it is for.
    pub robot: RobotFile,
    /// When the run ends.
    pub run: Run,
    /// How proposals become a command.
    pub arbiter: Arbiter,
    /// Every behavior, highest priority first, then by name.
    pub behaviors: Vec<BehaviorFile>,
    /// Wires that silence a behavior altogether.
    pub inhibit: Vec<Wire>,
    /// Wires that silence a behavior on the axes that another claims.
    pub suppress: Vec<Wire>,
    pub(crate) places: super::places::Places,
}

/// When a run ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Longest time; none where only goal or sensors end it.
    pub duration: Option<Duration>,
    /// Where to arrive.
    pub goal: Option<GoalArea>,
    /// Simulated time of one step.
    pub step: Duration,
}

/// A place to arrive at, in the frame of the map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GoalArea {
    /// Along the map's x axis, meters.
    pub x_m: f64,
    /// Along the map's y axis, meters.
    pub y_m: f64,
    /// How near is there, meters.
    pub tolerance_m: f64,
}

/// How proposals become a command.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Arbiter {
    /// Longest time from one command to the next.
    pub period: Duration,
    /// Who gets an axis that several claim.
    pub policy: Policy,
    /// What is asked of the system's scheduler for the arbiter.
    #[serde(skip)]
    pub scheduling: Scheduling,
    /// Whether commands that rest on data older than a latency budget slow the robot.
    pub latency_slows: bool,
}

/// A behavior of a task file.
#[derive(Clone, Debug)]
pub struct BehaviorFile {
    /// Its name in the task file.
    pub name: String,
    /// What builds it.
    pub factory: Arc<dyn BehaviorFactory>,
    /// Its own keys, checked against its schema.
    pub table: toml::Table,
    /// What it is told when it is built.
    pub setup: Setup,
    /// What is plugged into its slots, in the order of the plugin's slots; an optional one may be absent.
    pub inputs: Vec<Input>,
    /// Higher wins.
    pub priority: i32,
    /// Whether its silence stops the robot.
    pub critical: bool,
    /// Whether it takes part from the start.
    pub enabled: bool,
    /// It is asked at least this often; none for new input only.
    pub period: Option<Duration>,
    /// Longest silence before it counts as dead: as written, or three of its periods, or of those of its fastest sensor.
    pub deadline: Duration,
    /// Computing time that one proposal may take.
    pub budget: Option<Duration>,
    /// Largest age of the instant that a proposal describes.
    pub max_age: Duration,
    /// Largest age of the oldest sensor data in a proposal.
    pub max_evidence_age: Duration,
    /// Age of the oldest sensor data above which a command of it is late.
    pub latency_budget: Option<Duration>,
    /// Shortest duration of a halt or limit.
    pub hold: Duration,
    /// How long it keeps an axis before a lower priority gets it.
    pub dwell: Duration,
    /// Where it runs while the robot runs live.
    pub isolation: Isolation,
    /// A process of it that shows no sign of life for longer hangs: the deadline as written, or three periods and at least
    /// a quarter of a second.
    pub patience: Duration,
    /// What is asked of the system's scheduler for it.
    pub scheduling: Scheduling,
    /// Whether it is not asked while it is inhibited.
    pub sleeps: bool,
    /// The program that it is, and its arguments; empty where it is a part of this one.
    pub exec: Vec<String>,
}

/// What is plugged into a slot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Input {
    /// The slot.
    pub slot: String,
    /// Where its messages come from.
    pub source: InputSource,
}

/// What an input is plugged into that goals are to come through.
pub(crate) const OPERATOR: &str = "operator";

/// Where messages come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub enum InputSource {
    /// A sensor of the robot file.
    Sensor(String),
    /// An output of another behavior of the task.
    Output {
        /// The behavior's name in the task file.
        behavior: String,
        /// Its output.
        output: String,
    },
    /// Whoever sends the running robot to a goal.
    Operator,
}

impl std::fmt::Display for InputSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            InputSource::Sensor(name) => f.write_str(name),
            InputSource::Output { behavior, output } => write!(f, "{behavior}.{output}"),
            InputSource::Operator => f.write_str(OPERATOR),
        }
    }
}

/// One behavior silences another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wire {
    /// Who silences while it is active.
    pub by: String,
    /// Who is silenced.
    pub what: String,
    /// How long after that.
    pub hold: Duration,
}

impl Task {
    /// The behavior of this name.
    pub fn behavior(&self, name: &str) -> Option<&BehaviorFile> {
        self.behaviors.iter().find(|behavior| behavior.name == name)
    }
}

impl BehaviorFile {
    /// A new one of it.
    ///
    /// # Errors
    /// What it refuses; never where the task was loaded with the same files still in place.
    pub fn build(&self) -> Result<Box<dyn Behavior>, BuildError> {
        self.factory.build(&self.table, &self.setup)
    }
}
