//! Replay of a live run from its log: each behavior repeats its calls with what each was handed, and the arbiter its decisions
//! with what it heard.
//!
//! Clocks are inputs: the time of each call and decision comes from the log, and so does the time at which a proposal was
//! sent.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::time::Instant;

use yamabico_arbiter::decide::ExplainContext;
use yamabico_core::message::{
    CallHeader, HeardHeader, Message, OverlayHeader, Proposal, RetuneHeader, SavedStateHeader, View,
};
use yamabico_core::time::Time;
use yamabico_host::topics;

use super::arbiter_replay::ArbiterReplay;
use super::behavior_replay::{BehaviorReplay, Past, Published};
use super::comparison::Comparison;
use super::control_change::ControlChanges;
use super::difference::ARBITER;
use super::losses::Losses;
use super::recorded_task::{RecordedTask, ReplayError};
use super::report::{Options, Part, Report, computed, heard_by_arbiter, of_arbiter};
use super::steps::{RecordedMessage, Steps, raw};
use super::what_if_recorder::WhatIfRecorder;
use super::window::{Key, Window, key};
use crate::execution::Plan;
use crate::record::Tap;

/// Time by which the recording is read ahead of the event that is repeated: the record of a call follows its end.
const LOOKAHEAD_S: f64 = 1.0;
/// Maximum number of saved states and requests of parameters that are kept.
const MAX_KEPT: usize = 4096;

/// A replay from the log, with everything that it has read.
struct LogReplay {
    behaviors: BTreeMap<String, BehaviorReplay>,
    arbiter: ArbiterReplay,
    window: Window,
    kept: Vec<Rc<RecordedMessage>>,
    /// Events that are still to be repeated, in the order of their stamps.
    events: BTreeMap<(u64, u64), Rc<RecordedMessage>>,
    /// Messages that a what-if computed otherwise, by topic and sequence number.
    replayed: BTreeMap<(String, u64), Rc<RecordedMessage>>,
    is_what_if: bool,
    part: Part,
    /// Time of the first message.
    first: Time,
    losses: Losses,
    comparison: Comparison,
    changes: ControlChanges,
    output: Option<WhatIfRecorder>,
    /// Time of the last event that was repeated, by behavior and for the arbiter.
    last_event: BTreeMap<String, Time>,
    /// Number of messages of each computed topic: recorded, and found again.
    recorded: BTreeMap<String, u64>,
    matched: BTreeMap<String, u64>,
}

/// Replays the live run of `recorded` from the recording `path`.
///
/// # Errors
/// The recording cannot be read, or a part does not open.
pub(super) fn replay_log(
    path: &Path,
    options: &Options,
    recorded: &RecordedTask,
) -> Result<Report, ReplayError> {
    let plan = Plan::new(&recorded.task, recorded.identity.run.seed);
    let behaviors = plan.behaviors.iter().map(|behavior| {
        let name = &behavior.setup.name;
        (name.clone(), BehaviorReplay::new(name, &plan, options.program.as_ref()))
    });
    let computed = computed(&plan);
    let output = match &options.output {
        Some(file) => Some(WhatIfRecorder::create(file, path, recorded, computed.clone())?),
        None => None,
    };
    let mut replay = LogReplay {
        behaviors: behaviors.collect(),
        arbiter: ArbiterReplay::new(plan.policy.clone(), &recorded.policy),
        window: Window::default(),
        kept: Vec::new(),
        events: BTreeMap::new(),
        replayed: BTreeMap::new(),
        is_what_if: !options.changes.is_empty(),
        part: options.part,
        first: recorded.identity.origin,
        losses: Losses::default(),
        comparison: Comparison::new(computed.clone(), &ExplainContext::of(&plan.policy, &[])),
        changes: ControlChanges::default(),
        output,
        last_event: BTreeMap::new(),
        recorded: BTreeMap::new(),
        matched: BTreeMap::new(),
    };
    if options.part != Part::Whole {
        replay.comparison.begin_in_the_middle(computed);
    }
    let (began, mut span, mut arrived) = (Instant::now(), None, 0);
    let mut steps = match options.part {
        Part::Decisions => {
            let heard = heard_by_arbiter(&plan).into_iter().chain([topics::HEARD.to_owned()]);
            Steps::read_headers(path, heard.chain(of_arbiter()).collect())
        }
        Part::Whole | Part::From(_) => Steps::read(path),
    };
    for step in &mut steps {
        let (first, newest) = span.unwrap_or((step.time, step.time));
        let newest: Time = newest.max(step.time);
        span = Some((first, newest));
        for message in step.messages {
            arrived += 1;
            replay.take(step.time, arrived, message);
        }
        replay.repeat_until(newest, LOOKAHEAD_S)?;
    }
    let played = steps.finish()?;
    let (first, newest) = span.unwrap_or_default();
    replay.repeat_until(newest, -LOOKAHEAD_S)?;
    let mut notes = recorded.notes(replay.comparison.first.is_some());
    notes.extend(replay.losses.note());
    notes.extend(
        replay.comparison.leaves_out_overlays.then(|| "overlays are not compared in a live run".to_owned()),
    );
    notes.extend(replay.finish(newest, played.broken_off.is_some()));
    let memories =
        replay.behaviors.values().filter_map(|behavior| Some((behavior.name().to_owned(), behavior.memory?)));
    notes.extend(replay.comparison.continued(&memories.collect()));
    notes.extend(
        options.part.note(span).filter(|_| replay.behaviors.values().all(|behavior| behavior.calls == 0)),
    );
    notes.extend(played.notes());
    notes.extend(replay.output.take().and_then(WhatIfRecorder::finish));
    let calls: u64 = replay.behaviors.values().map(|behavior| behavior.calls).sum();
    let LogReplay { comparison, changes, .. } = replay;
    if calls == 0 && comparison.topics.is_empty() {
        let reason = "it has no log of the calls".to_owned();
        return Err(ReplayError::Unsupported { path: path.to_owned(), reason });
    }
    let (seconds, wall_s) = (newest.seconds_after(first), began.elapsed().as_secs_f64());
    Ok(Report::new(path, recorded, options, comparison, changes, notes, (seconds, wall_s, None)))
}

impl LogReplay {
    /// Takes in a recorded message.
    fn take(&mut self, time: Time, arrived: u64, message: RecordedMessage) {
        if let Some(output) = &mut self.output {
            output.recorded(time, &message);
        }
        if let Some(count) = self.recorded.get_mut(&message.topic) {
            *count += 1;
        } else if self.comparison.computed().contains(&message.topic) {
            self.recorded.insert(message.topic.clone(), 1);
        }
        self.losses.count(&message);
        self.comparison.leaves_out_overlays |= message.message.name == OverlayHeader::NAME;
        let kind = message.message.name;
        let message = self.window.push(time, message);
        match kind {
            CallHeader::NAME | HeardHeader::NAME => {
                self.events.insert((key(&message).1, arrived), message);
            }
            SavedStateHeader::NAME | RetuneHeader::NAME => {
                if self.kept.len() == MAX_KEPT {
                    self.kept.drain(..MAX_KEPT / 2);
                }
                self.kept.push(message);
            }
            _ => {}
        }
    }

    /// Repeats the events whose stamps are older than `newest` by `age_s`.
    fn repeat_until(&mut self, newest: Time, age_s: f64) -> Result<(), ReplayError> {
        while let Some(entry) = self.events.first_entry()
            && newest.seconds_after(Time(entry.key().0)) >= age_s
        {
            let ((stamp_ns, _), event) = entry.remove_entry();
            self.repeat(Time(stamp_ns), &event)?;
        }
        Ok(())
    }

    fn repeat(&mut self, time: Time, event: &RecordedMessage) -> Result<(), ReplayError> {
        let (replayed, is_what_if) = (&self.replayed, self.is_what_if);
        let other = |topic: &str, sequence: u64| {
            is_what_if.then(|| replayed.get(&(topic.to_owned(), sequence)).cloned()).flatten()
        };
        let past = Past { window: &self.window, replayed: &other, kept: &self.kept };
        if let Some(View { header, items }) = View::<CallHeader>::of(raw(event)) {
            let Some(behavior) = self.behaviors.get_mut(header.behavior.as_str()) else { return Ok(()) };
            if !self.part.has_begun(self.first, time) {
                behavior.pass(header, items, &past);
                return Ok(());
            }
            self.last_event.insert(header.behavior.to_string(), time);
            let mut published = behavior.repeat(header, items, &past)?;
            if header.event == 0 && header.proposal != 0 && behavior.ended.is_none() && published.is_empty() {
                let topic = topics::proposal(behavior.name());
                self.comparison.missing(time, &topic, 1);
            }
            let recorded: Vec<_> = published
                .iter_mut()
                .map(|message| recorded_twin(&self.window, header, message, self.part))
                .collect();
            self.compare(time, published, recorded);
        } else if let Some(View { header, items }) = View::<HeardHeader>::of(raw(event)) {
            self.last_event.insert(ARBITER.to_owned(), time);
            let published = self.arbiter.repeat(header, items, &past);
            let recorded =
                published.iter().map(|message| self.window.find(&message.topic, key(message)).cloned());
            let recorded: Vec<_> = recorded.collect();
            let has_decided = !published.is_empty();
            self.compare(time, published, recorded);
            if has_decided {
                self.changes.compare(time, &self.comparison.recorded, &self.comparison.replayed);
            }
        }
        Ok(())
    }

    fn compare(&mut self, time: Time, published: Published, recorded: Vec<Option<Rc<RecordedMessage>>>) {
        for (message, recorded) in published.into_iter().zip(recorded) {
            if recorded.is_some() {
                *self.matched.entry(message.topic.clone()).or_default() += 1;
            }
            self.comparison.pair(time, &message, recorded.as_deref());
            if let Some(output) = &mut self.output {
                output.message(&message.topic, &message.message, time, &message.header, &message.items);
            }
            if self.is_what_if {
                let sequence = key(&message).0;
                self.replayed.insert((message.topic.clone(), sequence), Rc::new(message));
            }
        }
        self.comparison.resolve();
    }

    /// Counts recorded messages that the replay did not find again; returns what limits the replay. In a recording that breaks off, the
    /// log may end a little before the messages.
    fn finish(&mut self, time: Time, is_broken_off: bool) -> Vec<String> {
        let mut notes: Vec<String> =
            self.behaviors.values().filter_map(|replay| replay.ended.clone()).collect();
        notes.extend(self.arbiter.ended.clone());
        for (topic, recorded) in std::mem::take(&mut self.recorded) {
            let of_behavior = self.behaviors.values().find(|behavior| {
                topic
                    .strip_prefix("behaviors/")
                    .and_then(|rest| rest.strip_prefix(behavior.name()))
                    .is_some_and(|rest| rest.starts_with('/'))
            });
            let (has_ended, cut_off) = match of_behavior {
                Some(behavior) => (behavior.ended.is_some(), u64::from(behavior.restarts) + 1),
                None => (self.arbiter.ended.is_some(), 1),
            };
            let author = of_behavior.map_or(ARBITER, BehaviorReplay::name);
            let logged_until = self.last_event.get(author).filter(|_| is_broken_off);
            let not_logged = logged_until.map_or(0, |until| self.window.count_after(&topic, *until));
            let cut_off = not_logged.max(cut_off);
            let missing = recorded.saturating_sub(self.matched.get(&topic).copied().unwrap_or(0));
            if missing == 0 || has_ended || (of_behavior.is_some() && self.part != Part::Whole) {
                continue;
            }
            if missing <= cut_off {
                notes.push(format!("{topic}: {missing} from calls that a kill or the end cut off"));
            } else if !self.is_what_if {
                self.comparison.missing(time, &topic, missing);
                self.comparison.resolve();
            }
        }
        notes
    }
}

/// Recorded counterpart of a message that a call published. The time at which a proposal was sent is a reading of the clock, and
/// taken from there.
fn recorded_twin(
    window: &Window,
    call: &CallHeader,
    message: &mut RecordedMessage,
    part: Part,
) -> Option<Rc<RecordedMessage>> {
    let Some(proposal) = View::<Proposal>::of(raw(message)).map(|view| *view.header) else {
        let (number, stamp_ns) = key(message);
        // A behavior that began in the middle counts its outputs from there.
        let is_it = |known: &Key| known.1 == stamp_ns && (part != Part::Whole || known.0 == number);
        return window.search(&message.topic, |known, _| is_it(known)).cloned();
    };
    let of = |recorded: &RecordedMessage| View::<Proposal>::of(raw(recorded)).map(|view| *view.header);
    let is_it =
        |recorded: &RecordedMessage| of(recorded).is_some_and(|known| known.received_ns == call.stamp_ns);
    let found = window
        .search(&message.topic, |(sequence, _), recorded| *sequence == call.proposal && is_it(recorded))
        .cloned()?;
    let proposed_ns = of(&found)?.proposed_ns;
    message.header = bytemuck::bytes_of(&Proposal { proposed_ns, ..proposal }).to_vec();
    Some(found)
}
