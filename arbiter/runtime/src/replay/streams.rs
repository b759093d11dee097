//! Replay of a lockstep run on all processors: the arbiter and each behavior on a thread of its own, every one with the recorded
//! messages of the others.
//!
//! None waits for another, so that one may be many steps ahead. If every message is equal, then so it is in a replay step by
//! step, in which each gets what the others just published: by induction over the steps. If any differs, only that replay tells
//! what follows from it.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use yamabico_arbiter::decide::ExplainContext;
use yamabico_core::message::{DecisionHeader, Message, MessageType, OverlayHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, RawPublisher, RawSubscriber};
use yamabico_host::{HostError, topics};

use super::comparison::{Comparison, TopicComparison};
use super::control_change::ControlChanges;
use super::in_lockstep::ends;
use super::recorded_task::{RecordedTask, ReplayError};
use super::report::{OVERLAYS_LEFT_OUT, Options, Report, computed, heard_by_arbiter, of_arbiter};
use super::steps::{RecordedMessage, Step, Steps};
use crate::execution::{HostedBehavior, Hosting, Lockstep, Plan};
use crate::record::Tap;
use crate::supervisor::Program;

/// Steps by which one part may be ahead of another.
const AHEAD: usize = 64;

/// Messages of one part, counted by topic, and its computing time.
#[derive(Default)]
struct Counted {
    topics: BTreeMap<String, TopicComparison>,
    computing: Duration,
}

/// Replays every part of the run of `recorded` by itself; returns `None` if any message differs.
///
/// # Errors
/// The recording cannot be read, or a part does not open.
pub(super) fn replay_streams(
    path: &Path,
    options: &Options,
    recorded: &RecordedTask,
    plan: &Plan,
) -> Result<Option<Report>, ReplayError> {
    let (began, mut span, mut count) = (Instant::now(), None, 0);
    let (differs, mut has_overlays) = (AtomicBool::new(false), false);
    let mut steps = Steps::read(path);
    let parts = std::thread::scope(|scope| {
        let mut senders: Vec<SyncSender<Arc<Step>>> = Vec::new();
        let mut threads = Vec::new();
        let names = plan.behaviors.iter().map(|behavior| Some(behavior.setup.name.as_str()));
        for name in names.chain([None]) {
            let (sender, steps) = sync_channel(AHEAD);
            senders.push(sender);
            let (differs, program) = (&differs, options.program.as_ref());
            threads.push(scope.spawn(move || match name {
                Some(name) => BehaviorPart::open(plan, name, program)?.run(&steps, differs),
                None => replay_arbiter(plan, recorded.identity.run.step, &steps, differs),
            }));
        }
        for step in &mut steps {
            let (first, _) = span.unwrap_or((step.time, step.time));
            span = Some((first, step.time));
            count += 1;
            has_overlays |= step.messages.iter().any(|message| message.message.name == OverlayHeader::NAME);
            let step = Arc::new(step);
            // A part that has ended early says why when it is joined.
            senders.iter().for_each(|sender| drop(sender.send(Arc::clone(&step))));
            if differs.load(Ordering::Relaxed) {
                break;
            }
        }
        drop(senders);
        let join = |thread: std::thread::ScopedJoinHandle<'_, Result<Counted, ReplayError>>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads.into_iter().map(join).collect::<Result<Vec<Counted>, ReplayError>>()
    })?;
    if differs.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let played = steps.finish()?;
    let mut comparison = Comparison::new(computed(plan), &ExplainContext::of(&plan.policy, &[]));
    let mut computing = Duration::ZERO;
    for part in parts {
        comparison.topics.extend(part.topics);
        computing += part.computing;
    }
    comparison.count_steps(count);
    let decisions = comparison.topics.get(topics::DECISION).map_or(0, |topic| topic.compared);
    let mut notes = recorded.notes(false);
    notes.extend(has_overlays.then(|| OVERLAYS_LEFT_OUT.to_owned()));
    notes.extend(played.notes());
    let seconds = span.map_or(0.0, |(first, last): (Time, Time)| last.seconds_after(first));
    let changes = ControlChanges { decisions, ..ControlChanges::default() };
    let times = (seconds, began.elapsed().as_secs_f64(), Some(computing.as_secs_f64()));
    Ok(Some(Report::new(path, recorded, options, comparison, changes, notes, times)))
}

/// One behavior, on a bus of its own.
struct BehaviorPart {
    // Ports are dropped before the bus.
    host: HostedBehavior,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    feeds: BTreeMap<String, RawPublisher>,
    /// Topics whose messages follow the calls of their step, since others compute them.
    late: BTreeSet<String>,
    counted: Counted,
    _bus: Bus,
}

impl BehaviorPart {
    fn open(plan: &Plan, name: &str, program: Option<&Program>) -> Result<BehaviorPart, ReplayError> {
        let own = plan.of_behavior(name);
        let bus = Bus::local("replay").map_err(HostError::from)?;
        own.create_topics(&bus).map_err(HostError::from)?;
        let is_own = |topic: &str| topic.starts_with(&topics::output(name, ""));
        let computed = computed(plan);
        let tap = |topic: &String| {
            let message = own.topics.iter().find(|known| known.name == *topic)?.message;
            Some(bus.tap(topic, &message).map(|tap| (topic.clone(), message, tap)))
        };
        let taps = computed.iter().filter(|topic| is_own(topic)).filter_map(tap);
        let inputs = own.behaviors.iter().flat_map(|behavior| &behavior.inputs);
        let inputs = inputs.map(|(_, topic, message)| (topic.clone(), *message));
        let decisions = (topics::DECISION.to_owned(), MessageType::of::<DecisionHeader>());
        let mut feeds = BTreeMap::new();
        for (topic, message) in inputs.chain([decisions]).filter(|(topic, _)| !is_own(topic)) {
            if let Entry::Vacant(entry) = feeds.entry(topic) {
                let feed = bus.publisher_raw(entry.key(), &message).map_err(HostError::from)?;
                entry.insert(feed);
            }
        }
        let hosting = Hosting { plan: &own, bus: &bus, program, publishes_states: false };
        let behavior = own.behaviors.first().cloned();
        let missing = || HostError::Process { name: name.to_owned(), reason: "it is not in the task".into() };
        Ok(BehaviorPart {
            taps: taps.collect::<Result<_, _>>().map_err(HostError::from)?,
            host: HostedBehavior::open(behavior.ok_or_else(missing)?, &hosting, &[])?,
            late: feeds.keys().filter(|topic| computed.contains(*topic)).cloned().collect(),
            feeds,
            counted: Counted::default(),
            _bus: bus,
        })
    }

    fn run(mut self, steps: &Receiver<Arc<Step>>, differs: &AtomicBool) -> Result<Counted, ReplayError> {
        while let Ok(step) = steps.recv() {
            if differs.load(Ordering::Relaxed) {
                break;
            }
            self.feed(&step, false)?;
            self.host.collect()?;
            self.host.prepare(step.time)?;
            self.host.propose(step.time)?;
            for (topic, _, tap) in &self.taps {
                let mut recorded = step.messages.iter().filter(|message| message.topic == *topic);
                let counts = self.counted.topics.entry(topic.clone()).or_default();
                while let Some(sample) = tap.receive().map_err(HostError::from)? {
                    let is_equal = recorded.next().is_some_and(|recorded| {
                        recorded.header == sample.header() && recorded.items == sample.items()
                    });
                    counts.compared += 1;
                    differs.fetch_or(!is_equal, Ordering::Relaxed);
                }
                differs.fetch_or(recorded.next().is_some(), Ordering::Relaxed);
            }
            self.feed(&step, true)?;
        }
        self.counted.topics.retain(|_, topic| topic.compared > 0);
        self.counted.computing = self.host.stats().calls.total();
        Ok(self.counted)
    }

    /// Publishes the recorded messages of a step that come before the calls, or those that come after them.
    fn feed(&self, step: &Step, is_late: bool) -> Result<(), HostError> {
        for RecordedMessage { topic, header, items, .. } in &step.messages {
            if let Some(feed) = self.feeds.get(topic).filter(|_| self.late.contains(topic) == is_late) {
                feed.publish(header, items)?;
            }
        }
        Ok(())
    }
}

/// Replays the decisions with the recorded proposals.
fn replay_arbiter(
    plan: &Plan,
    step: Duration,
    steps: &Receiver<Arc<Step>>,
    differs: &AtomicBool,
) -> Result<Counted, ReplayError> {
    let heard = heard_by_arbiter(plan);
    let mut lockstep = Lockstep::open_arbiter(plan.clone(), step)?;
    let mut counted = Decided { of_arbiter: of_arbiter(), published: Vec::new() };
    let mut topics: BTreeMap<String, TopicComparison> = BTreeMap::new();
    while let Ok(step) = steps.recv() {
        if differs.load(Ordering::Relaxed) {
            break;
        }
        lockstep.set_now(step.time);
        if ends(&step) {
            lockstep.shut_down();
        }
        for message in step.messages.iter().filter(|message| heard.contains(&message.topic)) {
            lockstep.feed(&message.topic, &message.message, &message.header, &message.items)?;
        }
        counted.published.clear();
        lockstep.decide(&mut counted)?;
        let mut recorded = step.messages.iter().filter(|message| counted.of_arbiter.contains(&message.topic));
        let mut published = counted.published.iter();
        loop {
            let (recorded, published) = (recorded.next(), published.next());
            let Some(published) = published else {
                differs.fetch_or(recorded.is_some(), Ordering::Relaxed);
                break;
            };
            let is_equal = recorded.is_some_and(|recorded| {
                (&recorded.topic, &recorded.header, &recorded.items)
                    == (&published.topic, &published.header, &published.items)
            });
            differs.fetch_or(!is_equal, Ordering::Relaxed);
            topics.entry(published.topic.clone()).or_default().compared += 1;
        }
    }
    Ok(Counted { topics, computing: Duration::ZERO })
}

/// Messages that the arbiter publishes in a step, in the order of the topics.
struct Decided {
    of_arbiter: BTreeSet<String>,
    published: Vec<RecordedMessage>,
}

impl Tap for Decided {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if self.of_arbiter.contains(topic) {
            self.published.push(RecordedMessage {
                topic: topic.to_owned(),
                message: *message,
                header: header.to_vec(),
                items: items.to_vec(),
            });
        }
    }
}
