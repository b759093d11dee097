//! Replay of a run in lockstep: the same schedule with recorded inputs in place of devices and operators.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use yamabico_arbiter::decide::ExplainContext;
use yamabico_core::message::{DecisionHeader, Message, Mode, OverlayHeader, RawMessage, View};
use yamabico_core::plugins::Plugins;
use yamabico_core::time::Time;

use super::comparison::{Comparison, FirstDifference, TopicComparison};
use super::control_change::{ControlChange, ControlChanges};
use super::recorded_task::{Changes, Devices, RecordedTask, ReplayError};
use super::steps::{Step, Steps};
use super::what_if_recorder::WhatIfRecorder;
use crate::execution::{Lockstep, Plan, topics};
use crate::record::{Tap, Tee};

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
    /// Number of steps.
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
}

/// Replays the recording `path` with behaviors of `plugins`, and compares.
///
/// # Errors
/// The recording cannot be read or replayed, or a part does not open.
pub fn replay(path: &Path, plugins: &Plugins, options: &Options) -> Result<Report, ReplayError> {
    let recorded = RecordedTask::open(path, &options.changes, plugins, Devices::Closed)?;
    if !recorded.is_lockstep() {
        let reason = format!("it was recorded in a {} run", recorded.identity.run.execution.as_str());
        return Err(ReplayError::Unsupported { path: path.to_owned(), reason });
    }
    let plan = Plan { devices: Vec::new(), ..Plan::new(&recorded.task, recorded.identity.run.seed) };
    let context = ExplainContext::of(&plan.policy, &[]);
    let mut comparison = Comparison::new(computed(&plan), &context);
    // Behaviors draw overlays for people: no input, and no result.
    let fed = plan.topics.iter().filter(|topic| topic.message.name != OverlayHeader::NAME);
    let fed: BTreeSet<String> = fed.map(|topic| topic.name.clone()).collect();
    let mut lockstep = Lockstep::open(plan, recorded.identity.run.step, options.threads)?;
    let mut output = match &options.output {
        Some(file) => Some(WhatIfRecorder::create(file, path, &recorded, comparison.computed().clone())?),
        None => None,
    };
    let (began, mut span, mut changes) = (Instant::now(), None, ControlChanges::default());
    let mut steps = Steps::read(path);
    for step in &mut steps {
        let time = step.time;
        let (first, _) = span.unwrap_or((time, time));
        span = Some((first, time));
        lockstep.set_now(time);
        if ends(&step) {
            lockstep.shut_down();
        }
        if let Some(output) = &mut output {
            step.messages.iter().for_each(|message| output.recorded(time, message));
        }
        for input in comparison.expect(step) {
            if fed.contains(&input.topic) {
                lockstep.feed(&input.topic, &input.message, &input.header, &input.items)?;
            }
        }
        let mut taps: Vec<&mut dyn Tap> = vec![&mut comparison];
        taps.extend(output.as_mut().map(|output| output as &mut dyn Tap));
        lockstep.step(&mut Tee(taps))?;
        comparison.settle(time);
        changes.compare(time, &comparison.recorded, &comparison.replayed);
    }
    let played = steps.finish()?;
    let mut notes = recorded.notes();
    notes.extend(played.left_out.into_iter().map(|what| format!("left out: {what}")));
    notes.extend(played.broken_off.map(|cause| format!("the recording breaks off: {cause}")));
    if let Some(output) = output {
        notes.extend(output.finish());
    }
    Ok(Report {
        recording: path.to_owned(),
        task: recorded.identity.run.name.clone(),
        steps: comparison.steps(),
        seconds: span.map_or(0.0, |(first, last): (Time, Time)| last.seconds_after(first)),
        wall_s: began.elapsed().as_secs_f64(),
        topics: comparison.topics,
        first: comparison.first,
        decisions: changes.decisions,
        differing_decisions: changes.differing,
        changes: changes.changes,
        open_loop: !options.changes.is_empty(),
        output: options.output.clone(),
        notes,
    })
}

/// Topics that the behaviors and the arbiter of `plan` publish on.
fn computed(plan: &Plan) -> BTreeSet<String> {
    let of_arbiter = [topics::DECISION, topics::COMMAND, topics::GOAL].map(str::to_owned);
    let of_behaviors = plan.behaviors.iter().flat_map(|behavior| {
        let name = &behavior.setup.name;
        let outputs = behavior.factory.info().outputs.iter().map(|slot| topics::output(name, &slot.name));
        outputs.chain([topics::proposal(name)])
    });
    of_behaviors.chain(of_arbiter).collect()
}

/// Returns true if the run was ending in this step. An emergency stop hides it, and makes it unnecessary.
fn ends(step: &Step) -> bool {
    let decisions = step.messages.iter().filter(|message| message.message.name == DecisionHeader::NAME);
    let mut decisions = decisions.filter_map(|message| {
        View::<DecisionHeader>::of(RawMessage { header: &message.header, items: &message.items })
            .map(|view| view.header.mode())
    });
    decisions.any(|mode| mode == Some(Mode::ShuttingDown))
}
