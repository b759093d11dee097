//! Checked task file.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use super::paths::absolute;
use super::robot::RobotFile;
use super::tables::Policy;
use crate::{BehaviorSettings, Scheduling};
use yamabico_core::behavior::{Behavior, BehaviorFactory, ParameterError, Setup};

/// Checked task file with its robot file.
#[derive(Clone, Debug)]
pub struct Task {
    /// Path of the file.
    pub path: PathBuf,
    /// Name of the file without folder and extension.
    pub name: String,
    /// Robot.
    pub robot: RobotFile,
    /// End of the run.
    pub run: Run,
    /// Maximum absolute coordinate of a goal, m; farther ones lie far outside the map and the world. `None` without them.
    pub max_goal_m: Option<f64>,
    /// Arbitration.
    pub arbiter: Arbiter,
    /// Behaviors, highest priority first, then by name.
    pub behaviors: Vec<BehaviorFile>,
    /// Wires that silence a behavior on all axes.
    pub inhibit: Vec<Wire>,
    /// Wires that silence a behavior on the axes that another one claims.
    pub suppress: Vec<Wire>,
    pub(crate) source_map: super::source_map::SourceMap,
}

/// End of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Maximum duration; `None` if only the goal or the sensors end the run.
    pub duration: Option<Duration>,
    /// Goal area.
    pub goal: Option<GoalArea>,
    /// Simulated time of one step.
    pub step: Duration,
}

/// Goal area in the map frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GoalArea {
    /// Position along the map's x axis, m.
    pub x_m: f64,
    /// Position along the map's y axis, m.
    pub y_m: f64,
    /// Distance at which the goal is reached, m.
    pub tolerance_m: f64,
}

/// Arbitration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Arbiter {
    /// Maximum time between two commands.
    pub period: Duration,
    /// Winner of an axis that several behaviors claim.
    pub policy: Policy,
    /// Scheduling of the arbiter by the operating system.
    #[serde(skip)]
    pub scheduling: Scheduling,
    /// If set, commands that are based on data older than a latency budget are slowed down.
    pub latency_slows: bool,
}

/// Behavior of a task file.
#[derive(Clone, Debug)]
pub struct BehaviorFile {
    /// Name in the task file.
    pub name: String,
    /// Factory that builds it.
    pub factory: Arc<dyn BehaviorFactory>,
    /// Parameters, checked against their schema.
    pub table: toml::Table,
    /// Description of the robot for its constructor.
    pub setup: Setup,
    /// Connected inputs, in the order of the plugin's slots.
    pub inputs: Vec<Input>,
    /// Notes for people on its inputs.
    pub notes: Vec<String>,
    /// Settings that the framework applies.
    pub settings: BehaviorSettings,
}

/// Connected input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Input {
    /// Name of the slot.
    pub slot: String,
    /// Source of its messages.
    pub source: InputSource,
}

/// Source name of the operator's goals and stick messages.
pub(crate) const OPERATOR: &str = "operator";

/// Source name of the arbiter's decisions.
pub(crate) const ARBITER: &str = "arbiter";

/// Source of messages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub enum InputSource {
    /// Sensor of the robot file.
    Sensor(String),
    /// Output of another behavior of the task.
    Output {
        /// Name of the behavior in the task file.
        behavior: String,
        /// Name of the output.
        output: String,
    },
    /// Operator of the running robot.
    Operator,
    /// Decisions of the arbiter.
    Arbiter,
}

impl std::fmt::Display for InputSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            InputSource::Sensor(name) => f.write_str(name),
            InputSource::Output { behavior, output } => write!(f, "{behavior}.{output}"),
            InputSource::Operator => f.write_str(OPERATOR),
            InputSource::Arbiter => f.write_str(ARBITER),
        }
    }
}

/// Wire: one behavior silences another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wire {
    /// Behavior that silences the other while it is active.
    pub by: String,
    /// Silenced behavior.
    pub what: String,
    /// Time for which it stays silenced afterwards.
    pub hold: Duration,
}

impl Task {
    /// Returns the behavior with this name.
    pub fn behavior(&self, name: &str) -> Option<&BehaviorFile> {
        self.behaviors.iter().find(|behavior| behavior.name == name)
    }

    /// Returns the files that the task was read from, with their texts: task, robot, included files, and the maps, worlds
    /// and tables that behaviors and devices name. Absolute paths, each once.
    ///
    /// # Errors
    /// The working directory is unknown.
    pub fn files(&self) -> std::io::Result<Vec<(PathBuf, &str)>> {
        let mut files: Vec<(PathBuf, &str)> = Vec::new();
        for source in self.source_map.sources.iter().filter(|source| !source.name.starts_with("--")) {
            let path = absolute(Path::new(&source.name))?;
            if files.iter().all(|(known, _)| *known != path) {
                files.push((path, &source.text));
            }
        }
        Ok(files)
    }

    /// Returns what people should know about the enabled behaviors before the robot starts: a text for each note, with
    /// the behavior's name.
    pub fn notes(&self) -> Vec<String> {
        let enabled = self.behaviors.iter().filter(|behavior| behavior.settings.enabled);
        let notes = enabled.flat_map(|behavior| {
            let of_plugin = behavior.factory.notes(&behavior.table, &behavior.setup);
            let notes = behavior.notes.iter().cloned().chain(of_plugin);
            notes.map(|note| format!("{}: {note}", behavior.name))
        });
        notes.collect()
    }
}

impl BehaviorFile {
    /// Builds an instance.
    ///
    /// # Errors
    /// The plugin refuses the parameters; never if the files that they name are unchanged since the task was loaded.
    pub fn build(&self) -> Result<Box<dyn Behavior>, ParameterError> {
        self.factory.build(&self.table, &self.setup)
    }
}
