//! Options and result of a replay.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::comparison::{Comparison, FirstDifference, TopicComparison};
use super::control_change::{ControlChange, ControlChanges};
use super::recorded_task::{Changes, RecordedTask};
use crate::execution::{Plan, topics};

/// Options of a replay.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Changes of the task: none compares the recording with itself, some ask "what if".
    pub changes: Changes,
    /// Number of threads for the behaviors.
    pub threads: usize,
    /// Recording to write: the recorded messages, and beside them the replayed ones under `/what-if/`.
    pub output: Option<PathBuf>,
}

/// Result of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Recording.
    pub recording: PathBuf,
    /// Name of the task.
    pub task: String,
    /// Number of steps; in a live run, of calls and decisions.
    pub steps: u64,
    /// Time from the first step to the last, s.
    pub seconds: f64,
    /// Computing time, s.
    pub wall_s: f64,
    /// Messages compared on each topic.
    pub topics: BTreeMap<String, TopicComparison>,
    /// First difference; `None` if every message is equal to the byte.
    pub first: Option<FirstDifference>,
    /// Number of pairs of decisions.
    pub decisions: u64,
    /// Number of those whose winners or commanded speeds differ.
    pub differing_decisions: u64,
    /// Changes of control, in the order of their beginning; at most 1000.
    pub changes: Vec<ControlChange>,
    /// Set if the task was changed: the world did not react, since its messages are the recorded ones.
    pub open_loop: bool,
    /// Recording that was written.
    pub output: Option<PathBuf>,
    /// Circumstances that may explain differences: another version or program, lost messages, an early end.
    pub notes: Vec<String>,
}

impl Report {
    /// Returns true if every message was compared and is equal to the byte.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        self.first.is_none() && self.compared() > 0
    }

    /// Number of messages compared.
    #[must_use]
    pub fn compared(&self) -> u64 {
        self.topics.values().map(|topic| topic.compared).sum()
    }

    /// Report on a finished comparison; `times` are the time of the run and the computing time, s.
    pub(super) fn new(
        path: &Path,
        recorded: &RecordedTask,
        options: &Options,
        comparison: Comparison,
        changes: ControlChanges,
        notes: Vec<String>,
        times: (f64, f64),
    ) -> Report {
        Report {
            recording: path.to_owned(),
            task: recorded.identity.run.name.clone(),
            steps: comparison.steps(),
            seconds: times.0,
            wall_s: times.1,
            topics: comparison.topics,
            first: comparison.first,
            decisions: changes.decisions,
            differing_decisions: changes.differing,
            changes: changes.changes,
            open_loop: !options.changes.is_empty(),
            output: options.output.clone(),
            notes,
        }
    }
}

/// Topics that the behaviors and the arbiter of `plan` publish on.
pub(super) fn computed(plan: &Plan) -> BTreeSet<String> {
    let of_arbiter = [topics::DECISION, topics::COMMAND, topics::GOAL].map(str::to_owned);
    let of_behaviors = plan.behaviors.iter().flat_map(|behavior| {
        let name = &behavior.setup.name;
        let outputs = behavior.factory.info().outputs.iter().map(|slot| topics::output(name, &slot.name));
        outputs.chain([topics::proposal(name)])
    });
    of_behaviors.chain(of_arbiter).collect()
}
