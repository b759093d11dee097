//! Replay of the decisions of a lockstep run alone: the arbiter without a bus hears the recorded proposals.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use yamabico_arbiter::decide::ExplainContext;
use yamabico_core::message::{Control, DecisionHeader, Goal, Message, MessageType, Proposal, View};
use yamabico_core::time::Time;
use yamabico_host::topics;

use super::comparison::Comparison;
use super::control_change::ControlChanges;
use super::in_lockstep::ends;
use super::recorded_task::{RecordedTask, ReplayError};
use super::report::{Options, Report, heard_by_arbiter, of_arbiter};
use super::steps::{RecordedMessage, Steps, raw};
use crate::execution::{ArbiterCore, Plan};
use crate::record::Tap;

/// Replays the decisions of the run of `recorded` from the recording `path`.
///
/// # Errors
/// The recording cannot be read.
pub(super) fn replay_decisions(
    path: &Path,
    options: &Options,
    recorded: &RecordedTask,
    plan: &Plan,
) -> Result<Report, ReplayError> {
    let (began, mut span) = (Instant::now(), None);
    let mut arbiter = Arbiter::new(plan);
    let mut comparison = Comparison::new(of_arbiter(), &ExplainContext::of(&plan.policy, &[]));
    let mut changes = ControlChanges::default();
    let mut steps =
        Steps::read_headers(path, heard_by_arbiter(plan).into_iter().chain(of_arbiter()).collect());
    for step in &mut steps {
        let time = step.time;
        let (first, _) = span.unwrap_or((time, time));
        span = Some((first, time));
        if ends(&step) {
            arbiter.core.shut_down();
        }
        let heard = comparison.expect(step);
        arbiter.decide(time, &heard, &mut comparison);
        comparison.settle(time);
        changes.compare(time, &comparison.recorded, &comparison.replayed);
    }
    let played = steps.finish()?;
    let notes = recorded.notes(comparison.first.is_some()).into_iter();
    let notes = notes.chain(options.part.note(span)).chain(played.notes()).collect();
    let seconds = span.map_or(0.0, |(first, last): (Time, Time)| last.seconds_after(first));
    let times = (seconds, began.elapsed().as_secs_f64(), None);
    Ok(Report::new(path, recorded, options, comparison, changes, notes, times))
}

/// The arbiter of a run in lockstep.
struct Arbiter {
    core: ArbiterCore,
    /// Contents of the topics that it hears.
    topics: BTreeMap<String, Heard>,
}

/// Contents of a topic, with the index of the behavior or sensor.
#[derive(Clone, Copy)]
enum Heard {
    Proposal(usize),
    Sensor(usize),
    Control,
}

impl Arbiter {
    fn new(plan: &Plan) -> Arbiter {
        let behaviors = plan.policy.behaviors.iter().enumerate();
        let proposals = behaviors
            .map(|(index, behavior)| (topics::proposal(behavior.name.as_str()), Heard::Proposal(index)));
        let sensors = plan.policy.sensors.iter().enumerate();
        let sensors =
            sensors.map(|(index, sensor)| (topics::sensor(sensor.name.as_str()), Heard::Sensor(index)));
        let controls = [(topics::CONTROL.to_owned(), Heard::Control)];
        Arbiter {
            topics: proposals.chain(sensors).chain(controls).collect(),
            core: ArbiterCore::new(plan.policy.clone()),
        }
    }

    /// Makes the step at `now`: hears the messages of the step, and publishes goals, command and decision to `tap`.
    fn decide(&mut self, now: Time, messages: &[RecordedMessage], tap: &mut dyn Tap) {
        for message in messages {
            match self.topics.get(&message.topic) {
                Some(Heard::Proposal(index)) => {
                    if let Some(proposal) = View::<Proposal>::of(raw(message)) {
                        self.core.hear_proposal(*index, *proposal.header, now);
                    }
                }
                Some(Heard::Sensor(index)) => {
                    let stamp = (message.message.stamps)(&message.header).0;
                    self.core.hear_sensor(*index, stamp);
                }
                Some(Heard::Control) => {
                    let control = View::<Control>::of(raw(message)).map(|control| *control.header);
                    if let Some(goal) = control.and_then(|control| self.core.hear_control(&control, now)) {
                        publish::<Goal>(tap, topics::GOAL, now, &goal, &[]);
                    }
                }
                None => {}
            }
        }
        self.core.decide(now);
        publish(tap, topics::COMMAND, now, &self.core.command(now), &[]);
        let (decision, verdicts) = self.core.message();
        publish::<DecisionHeader>(tap, topics::DECISION, now, &decision, verdicts);
    }
}

fn publish<M: Message>(tap: &mut dyn Tap, topic: &str, now: Time, header: &M, items: &[M::Item]) {
    let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
    tap.message(topic, &MessageType::of::<M>(), now, header, items);
}
