//! Replay of a run in lockstep: the same schedule with recorded inputs in place of devices and operators.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

use yamabico_arbiter::decide::ExplainContext;
use yamabico_core::message::{DecisionHeader, Message, Mode, OverlayHeader, View};
use yamabico_core::time::Time;

use super::comparison::Comparison;
use super::control_change::ControlChanges;
use super::decisions::replay_decisions;
use super::prelude::Prelude;
use super::recorded_task::{RecordedTask, ReplayError};
use super::report::{OVERLAYS_LEFT_OUT, Options, Part, Report, computed, heard_by_arbiter, of_arbiter};
use super::steps::{Step, Steps, raw};
use super::streams::replay_streams;
use super::what_if_recorder::WhatIfRecorder;
use crate::execution::{Lockstep, Overlays, Plan, Topic};
use crate::record::{Tap, Tee};

/// Replays the lockstep run of `recorded` from the recording `path`.
///
/// # Errors
/// The recording cannot be read, or a part does not open.
pub(super) fn replay_lockstep(
    path: &Path,
    options: &Options,
    recorded: &RecordedTask,
) -> Result<Report, ReplayError> {
    let plan = Plan {
        devices: Vec::new(),
        overlays: options.overlays,
        ..Plan::new(&recorded.task, recorded.identity.run.seed)
    };
    let is_plain = options.changes.is_empty()
        && options.part == Part::Whole
        && options.output.is_none()
        && options.overlays == Overlays::OnRequest;
    if is_plain
        && options.threads > 1
        && let Some(report) = replay_streams(path, options, recorded, &plan)?
    {
        return Ok(report);
    }
    if options.part == Part::Decisions && options.output.is_none() {
        return replay_decisions(path, options, recorded, &plan);
    }
    let context = ExplainContext::of(&plan.policy, &[]);
    let all = computed(&plan);
    // Overlays are drawings, which are not drawn here.
    let is_fed = |topic: &&Topic| topic.message.name != OverlayHeader::NAME;
    let fed: BTreeSet<String> = plan.topics.iter().filter(is_fed).map(|topic| topic.name.clone()).collect();
    let (step, program) = (recorded.identity.run.step, options.program.as_ref());
    let mut output = match &options.output {
        Some(file) => Some(WhatIfRecorder::create(file, path, recorded, all.clone())?),
        None => None,
    };
    let heard = heard_by_arbiter(&plan);
    let mut prelude = Some(Prelude::new(&plan)).filter(|_| options.part != Part::Whole);
    let (mut comparison, mut lockstep) = match prelude {
        None => {
            (Comparison::new(all.clone(), &context), Lockstep::open(plan, step, options.threads, program)?)
        }
        Some(_) => (Comparison::new(of_arbiter(), &context), Lockstep::open_arbiter(plan, step)?),
    };
    let (mut memories, mut asleep) = (None, None);
    let (began, mut span, mut changes) = (Instant::now(), None, ControlChanges::default());
    let mut steps = match options.part {
        Part::Decisions => Steps::read_topics(path, heard.iter().cloned().chain(of_arbiter()).collect()),
        Part::Whole | Part::From(_) => Steps::read(path),
    };
    for step in &mut steps {
        let time = step.time;
        let (first, _) = span.unwrap_or((time, time));
        span = Some((first, time));
        lockstep.set_now(time);
        if let Some(past) = prelude.take_if(|_| options.part.has_begun(first, time)) {
            lockstep.open_behaviors(options.threads, program, Some(past.lives()))?;
            for message in past.newest() {
                lockstep.feed(&message.topic, &message.message, &message.header, &message.items)?;
            }
            lockstep.show(&mut Tee::default())?;
            comparison.begin_in_the_middle(all.clone());
            memories = Some(past.memories());
            asleep = Some(past);
        }
        if let Some(asleep) = &mut asleep {
            // Each goes on with its next recorded call.
            lockstep.resume(asleep.take_lives(&step))?;
        }
        if ends(&step) {
            lockstep.shut_down();
        }
        if let Some(output) = &mut output {
            step.messages.iter().for_each(|message| output.recorded(time, message));
        }
        if let Some(prelude) = &mut prelude {
            step.messages.iter().for_each(|message| prelude.take(message));
        }
        let is_fed =
            |topic: &str| if prelude.is_some() { heard.contains(topic) } else { fed.contains(topic) };
        for input in comparison.expect(step) {
            if is_fed(&input.topic) {
                lockstep.feed(&input.topic, &input.message, &input.header, &input.items)?;
            }
        }
        let mut taps: Vec<&mut dyn Tap> = vec![&mut comparison];
        taps.extend(output.as_mut().map(|output| output as &mut dyn Tap));
        match prelude {
            Some(_) => lockstep.decide(&mut Tee(taps))?,
            None => drop(lockstep.step(&mut Tee(taps))?),
        }
        comparison.settle(time);
        changes.compare(time, &comparison.recorded, &comparison.replayed);
    }
    let played = steps.finish()?;
    let mut notes = recorded.notes(comparison.first.is_some());
    notes.extend(memories.iter().flat_map(|memories| comparison.continued(memories)));
    notes.extend(prelude.as_ref().and_then(|_| options.part.note(span)));
    notes.extend(comparison.leaves_out_overlays.then(|| OVERLAYS_LEFT_OUT.to_owned()));
    notes.extend(played.notes());
    if let Some(output) = output {
        notes.extend(output.finish());
    }
    let seconds = span.map_or(0.0, |(first, last): (Time, Time)| last.seconds_after(first));
    let wall_s = began.elapsed().as_secs_f64();
    let calls = lockstep.finish().behaviors;
    let calls_s: f64 = calls.iter().map(|(_, calls)| calls.calls.total().as_secs_f64()).sum();
    let times = (seconds, wall_s, Some(calls_s).filter(|_| !calls.is_empty()));
    Ok(Report::new(path, recorded, options, comparison, changes, notes, times))
}

/// Returns true if the run was ending in this step. An emergency stop hides it, and makes it unnecessary.
pub(super) fn ends(step: &Step) -> bool {
    let decisions = step.messages.iter().filter(|message| message.message.name == DecisionHeader::NAME);
    let mut decisions = decisions
        .filter_map(|message| View::<DecisionHeader>::of(raw(message)).map(|view| view.header.mode()));
    decisions.any(|mode| mode == Some(Mode::ShuttingDown))
}
