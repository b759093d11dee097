//! Options and result of a replay.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;
use yamabico_core::time::Time;

use super::comparison::{Comparison, FirstDifference, TopicComparison};
use super::control_change::{ControlChange, ControlChanges};
use super::recorded_task::{Changes, Programs, RecordedTask};
use crate::execution::{Overlays, Plan, topics};
use crate::supervisor::Program;

/// Note on a recording in lockstep whose overlays are not replayed.
pub(super) const OVERLAYS_LEFT_OUT: &str = "overlays are not compared; --overlays compares them";

/// Part of a recording that is replayed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Part {
    /// Everything.
    #[default]
    Whole,
    /// The decisions from the beginning, and the behaviors from this time on, s, with what they had saved by then.
    From(f64),
    /// The decisions alone, from the recorded proposals.
    Decisions,
}

impl Part {
    /// Returns true if the behaviors are replayed at `time` of a recording that begins at `first`.
    pub(super) fn has_begun(self, first: Time, time: Time) -> bool {
        match self {
            Part::Whole => true,
            Part::From(from_s) => time.seconds_after(first) >= from_s,
            Part::Decisions => false,
        }
    }

    /// Note on a replay in which no behavior was called; `span` is that of the recording.
    pub(super) fn note(self, span: Option<(Time, Time)>) -> Option<String> {
        let seconds = span.map_or(0.0, |(first, last)| last.seconds_after(first));
        match self {
            Part::Whole => None,
            Part::From(from_s) => Some(format!(
                "no behavior is replayed: the recording ends at {seconds:.2} s, before {from_s} s"
            )),
            Part::Decisions => Some("the decisions alone: proposals are the recorded ones".to_owned()),
        }
    }
}

/// Options of a replay.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Part of the recording.
    pub part: Part,
    /// Changes of the task: none compares the recording with itself, some ask "what if".
    pub changes: Changes,
    /// Number of threads for the behaviors.
    pub threads: usize,
    /// Comparison of overlays in lockstep, which are drawn for that; in a live run they are not compared.
    pub overlays: Overlays,
    /// Program that starts the external programs of the recorded task; without it a recording that names any is refused, since
    /// it may come from anybody.
    pub program: Option<Program>,
    /// Recording to write: the recorded messages, and beside them the replayed ones under `/what-if/`.
    pub output: Option<PathBuf>,
}

impl Options {
    /// Treatment of external programs.
    pub(super) fn programs(&self) -> Programs {
        if self.program.is_some() { Programs::Started } else { Programs::Refused }
    }
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
    /// Time that the replay took, s.
    pub wall_s: f64,
    /// Sum of the durations of all calls of behaviors, s: what they would take one after the other. `None` in a live run.
    pub behaviors_s: Option<f64>,
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

    /// Report on a finished comparison; `times` are the time of the run, that of the replay and that of the calls, s.
    pub(super) fn new(
        path: &Path,
        recorded: &RecordedTask,
        options: &Options,
        comparison: Comparison,
        changes: ControlChanges,
        notes: Vec<String>,
        times: (f64, f64, Option<f64>),
    ) -> Report {
        Report {
            recording: path.to_owned(),
            task: recorded.identity.run.name.clone(),
            steps: comparison.steps(),
            seconds: times.0,
            wall_s: times.1,
            behaviors_s: times.2,
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

/// Topics that the arbiter publishes on.
pub(super) fn of_arbiter() -> BTreeSet<String> {
    [topics::DECISION, topics::COMMAND, topics::GOAL].map(str::to_owned).into()
}

/// Topics that the arbiter of `plan` subscribes to.
pub(super) fn heard_by_arbiter(plan: &Plan) -> BTreeSet<String> {
    let proposals = plan.behaviors.iter().map(|behavior| topics::proposal(&behavior.setup.name));
    let sensors = plan.policy.sensors.iter().map(|sensor| topics::sensor(sensor.name.as_str()));
    proposals.chain(sensors).chain([topics::CONTROL.to_owned()]).collect()
}

/// Topics that the behaviors and the arbiter of `plan` publish on.
pub(super) fn computed(plan: &Plan) -> BTreeSet<String> {
    let of_behaviors = plan.behaviors.iter().flat_map(|behavior| {
        let name = &behavior.setup.name;
        let outputs = behavior.factory.info().outputs.iter().map(|slot| topics::output(name, &slot.name));
        let overlay = (plan.overlays == Overlays::Recorded).then(|| topics::overlay(name));
        outputs.chain([topics::proposal(name)]).chain(overlay)
    });
    of_behaviors.chain(of_arbiter()).collect()
}
