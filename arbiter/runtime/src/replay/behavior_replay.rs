//! One behavior of a live run again: the calls of its log, with the inputs that each was handed.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use yamabico_core::message::{
    CallEvent, CallHeader, CallInput, MessageType, Proposal, RetuneHeader, RetuneStep, SavedStateHeader,
    View, state_hash,
};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawPublisher, RawSubscriber, TopicSpec};
use yamabico_host::{HostError, topics};

use super::prelude::Memory;
use super::recorded_task::ReplayError;
use super::steps::{RecordedMessage, raw};
use super::window::Window;
use crate::execution::{HostedBehavior, Hosting, Plan, Topic};
use crate::supervisor::Program;

/// Messages of a call: topic, type, header and items.
pub(super) type Published = Vec<RecordedMessage>;

/// Room for recorded lists that are longer than the task of the replay would make them, bytes: the decisions about
/// behaviors that a what-if leaves out.
const RECORDED_LIST_BYTES: usize = 32 << 10;

/// A behavior under replay.
pub(super) struct BehaviorReplay {
    instance: Option<Instance>,
    /// The part of the plan that concerns it, with a topic for each slot.
    plan: Plan,
    /// Recorded topics of its slots.
    slots: Vec<String>,
    /// Parameters of the task file.
    table: toml::Table,
    program: Option<Program>,
    name: String,
    instances: u32,
    sequence: u64,
    /// Cause why the replay of this behavior has ended early.
    pub ended: Option<String>,
    /// Number of instances after the first, and of calls.
    pub restarts: u32,
    pub calls: u64,
    /// Memory with which it began in the middle of the recording, if it did.
    pub memory: Option<Memory>,
    /// Remains of the events that were passed over, for the first call.
    passed: Option<Passed>,
}

/// Remains of events that are not repeated, for the first call that is.
#[derive(Default)]
struct Passed {
    /// Newest message of each slot.
    newest: BTreeMap<usize, Rc<RecordedMessage>>,
    /// Request of the parameters; zero for those of the task file.
    request: u64,
    /// Number of the last proposal since the start.
    proposal: u64,
    is_started: bool,
}

/// One life of the behavior, on a bus of its own: nothing that an earlier one was handed comes again by itself.
struct Instance {
    // Ports are dropped before the bus.
    host: HostedBehavior,
    feeds: Vec<RawPublisher>,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    bus: Bus,
}

/// Source of what a call needs besides its own record.
pub(super) struct Past<'a> {
    /// The last seconds of the recording.
    pub window: &'a Window,
    /// Messages that the replay computed otherwise than recorded.
    pub replayed: &'a dyn Fn(&str, u64) -> Option<Rc<RecordedMessage>>,
    /// Newest saved states and requests of parameters.
    pub kept: &'a [Rc<RecordedMessage>],
}

impl BehaviorReplay {
    /// Prepares the replay of the behavior `name` of `plan`. As an external program it becomes a process of `program`.
    pub fn new(name: &str, plan: &Plan, program: Option<&Program>) -> BehaviorReplay {
        let mut own = plan.of_behavior(name);
        let list_bytes = |topic: &str| {
            plan.topics.iter().find(|known| known.name == topic).map_or(0, |known| known.spec.list_bytes)
        };
        let (mut slots, mut fed, mut table) = (Vec::new(), Vec::new(), toml::Table::new());
        for behavior in &mut own.behaviors {
            // It is called when the log says so.
            behavior.settings.period = Some(Duration::ZERO);
            behavior.settings.sleeps_while_inhibited = false;
            table.clone_from(&behavior.table);
            for (slot, topic, message) in &mut behavior.inputs {
                let room = if message.item_size > 0 { RECORDED_LIST_BYTES } else { 0 };
                let list_bytes = list_bytes(topic).max(room);
                let spec = TopicSpec { list_bytes, subscribers: 4, ..TopicSpec::default() };
                let slot_topic = format!("replay/{slot}");
                slots.push(std::mem::replace(topic, slot_topic.clone()));
                fed.push(Topic { name: slot_topic, message: *message, spec });
            }
        }
        own.topics.retain(|topic| !slots.contains(&topic.name));
        own.topics.extend(fed);
        BehaviorReplay {
            instance: None,
            plan: own,
            slots,
            table,
            program: program.cloned(),
            name: name.to_owned(),
            instances: 0,
            sequence: 0,
            ended: None,
            restarts: 0,
            calls: 0,
            memory: None,
            passed: None,
        }
    }

    /// Name of the behavior.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Passes over an event of the log before the part that is replayed.
    pub fn pass(&mut self, header: &CallHeader, inputs: &[CallInput], past: &Past<'_>) {
        self.sequence = header.sequence;
        let passed = self.passed.get_or_insert_default();
        match header.event() {
            Some(CallEvent::Start) => {
                *passed = Passed { request: header.request, is_started: true, ..Passed::default() };
            }
            Some(CallEvent::Retune) => passed.request = header.request,
            Some(CallEvent::Call) => {
                if header.proposal > 0 {
                    passed.proposal = header.proposal;
                }
                for input in inputs {
                    let slot = input.slot as usize;
                    let topic = self.slots.get(slot);
                    let found =
                        topic.and_then(|topic| past.window.find(topic, (input.sequence, input.stamp_ns)));
                    if let Some(found) = found {
                        passed.newest.insert(slot, Rc::clone(found));
                    }
                }
            }
            None => {}
        }
    }

    /// Begins in the middle, before the call of `header`, with what the events that were passed over left.
    fn begin(&mut self, header: &CallHeader, past: &Past<'_>) -> Result<(), Failure> {
        let Some(passed) = self.passed.take() else { return Ok(()) };
        if header.event() == Some(CallEvent::Start) {
            self.memory = Some(Memory::NotNeeded);
            return Ok(());
        }
        if !passed.is_started {
            return Err(Failure::Missing("its start is not recorded".to_owned()));
        }
        let table = match passed.request {
            0 => self.table.clone(),
            request => self.parameters_of(request, past)?,
        };
        let state = past.kept.iter().rev().find_map(|message| {
            let view = View::<SavedStateHeader>::of(raw(message))?;
            let is_it = view.header.plugin.as_str() == self.name && view.header.stamp_ns < header.stamp_ns;
            is_it.then_some(view.items)
        });
        self.memory = Some(match (passed.proposal, state) {
            (0, _) => Memory::NotNeeded,
            (_, None) => Memory::None,
            (_, Some(_)) => Memory::Restored,
        });
        self.instances += 1;
        let mut instance = self.open(table, state.unwrap_or_default())?;
        for (slot, message) in &passed.newest {
            if let Some(feed) = instance.feeds.get(*slot) {
                feed.publish(&message.header, &message.items).map_err(HostError::from)?;
            }
        }
        instance.host.resume(passed.proposal);
        self.instance = Some(instance);
        Ok(())
    }

    /// Repeats an event of the log; returns what a call published.
    ///
    /// # Errors
    /// The bus fails, or the behavior cannot be built.
    pub fn repeat(
        &mut self,
        header: &CallHeader,
        inputs: &[CallInput],
        past: &Past<'_>,
    ) -> Result<Published, ReplayError> {
        if self.ended.is_some() {
            return Ok(Published::new());
        }
        let is_start = header.event() == Some(CallEvent::Start);
        if !is_start && header.sequence != self.sequence + 1 {
            let lost = header.sequence.saturating_sub(self.sequence + 1);
            self.end(header, format!("{lost} records of its calls are lost"));
            return Ok(Published::new());
        }
        self.sequence = header.sequence;
        let outcome = self.begin(header, past).and_then(|()| self.dispatch(header, inputs, past));
        match outcome {
            Ok(published) => Ok(published),
            Err(Failure::Missing(what)) => {
                self.end(header, what);
                Ok(Published::new())
            }
            Err(Failure::Replay(error)) => Err(error),
        }
    }

    fn dispatch(
        &mut self,
        header: &CallHeader,
        inputs: &[CallInput],
        past: &Past<'_>,
    ) -> Result<Published, Failure> {
        match header.event() {
            Some(CallEvent::Start) => self.start(header, past).map(|()| Published::new()),
            Some(CallEvent::Retune) => self.retune(header, past).map(|()| Published::new()),
            Some(CallEvent::Call) => self.call(header, inputs, past),
            None => Err(Failure::Missing("an event of an unknown kind is logged".to_owned())),
        }
    }

    fn end(&mut self, header: &CallHeader, what: String) {
        self.instance = None;
        let time_s = Time(header.stamp_ns).as_secs_f64();
        self.ended = Some(format!("{} is replayed up to {time_s:.3} s (stamp): {what}", self.name));
    }

    fn start(&mut self, header: &CallHeader, past: &Past<'_>) -> Result<(), Failure> {
        // The program of the last life ends before the next one begins.
        self.instance = None;
        self.restarts += u32::from(self.instances > 0);
        self.instances += 1;
        let table = match header.request {
            0 => self.table.clone(),
            request => self.parameters_of(request, past)?,
        };
        let state = past.kept.iter().rev().find_map(|message| {
            let view = View::<SavedStateHeader>::of(raw(message))?;
            let is_it = view.header.plugin.as_str() == self.name && state_hash(view.items) == header.state;
            is_it.then_some(view.items)
        });
        let state = match (header.state, state) {
            (0, _) => &[],
            (_, Some(state)) => state,
            (_, None) => {
                let missing = "the state that it was restarted with is not recorded";
                return Err(Failure::Missing(missing.to_owned()));
            }
        };
        self.instance = Some(self.open(table, state)?);
        Ok(())
    }

    fn open(&mut self, table: toml::Table, state: &[u8]) -> Result<Instance, HostError> {
        self.plan.behaviors.iter_mut().for_each(|behavior| behavior.table.clone_from(&table));
        let (name, plan) = (&self.name, &self.plan);
        let bus = Bus::local("replay")?;
        plan.create_topics(&bus)?;
        let missing =
            || HostError::Process { name: name.clone(), reason: "it is not in the task".to_owned() };
        let behavior = plan.behaviors.first().ok_or_else(missing)?;
        let outputs = behavior.factory.info().outputs.iter();
        let outputs = outputs.map(|slot| (topics::output(name, &slot.name), slot.message));
        let taps = outputs
            .chain([(topics::proposal(name), MessageType::of::<Proposal>())])
            .map(|(topic, message)| Ok((topic.clone(), message, bus.tap(&topic, &message)?)));
        let feeds = behavior.inputs.iter().map(|(_, topic, message)| bus.publisher_raw(topic, message));
        let program = self.program.as_ref();
        let hosting = Hosting { plan, bus: &bus, program, publishes_states: false };
        Ok(Instance {
            taps: taps.collect::<Result<_, BusError>>()?,
            feeds: feeds.collect::<Result<_, BusError>>()?,
            host: HostedBehavior::open(behavior.clone(), &hosting, state)?,
            bus,
        })
    }

    /// Parameters that a request set.
    fn parameters_of(&self, request: u64, past: &Past<'_>) -> Result<toml::Table, Failure> {
        let text = past.kept.iter().rev().find_map(|message| {
            let view = View::<RetuneHeader>::of(raw(message))?;
            let is_it = view.header.request == request
                && view.header.behavior.as_str() == self.name
                && view.header.step() != Some(RetuneStep::Drop);
            is_it.then(|| String::from_utf8_lossy(view.items).into_owned())
        });
        let missing = |what: &str| Failure::Missing(what.to_owned());
        let text = text.ok_or_else(|| missing("its new parameters are not recorded"))?;
        text.parse().map_err(|_| missing("its new parameters are not valid"))
    }

    fn retune(&mut self, header: &CallHeader, past: &Past<'_>) -> Result<(), Failure> {
        let table = self.parameters_of(header.request, past)?;
        match &mut self.instance {
            Some(instance) => Ok(instance.host.retune(table, &instance.bus)?),
            None => Err(Failure::Missing("its start is not recorded".to_owned())),
        }
    }

    fn call(
        &mut self,
        header: &CallHeader,
        inputs: &[CallInput],
        past: &Past<'_>,
    ) -> Result<Published, Failure> {
        let missing = |what: String| Failure::Missing(what);
        let Some(Instance { host, feeds, taps, .. }) = &mut self.instance else {
            return Err(missing("its start is not recorded".to_owned()));
        };
        if header.left_out > 0 {
            return Err(missing(format!("{} inputs of a call are not logged", header.left_out)));
        }
        // What had been received before the call is received again before its fresh inputs.
        for is_fresh in [false, true] {
            for input in inputs.iter().filter(|input| (input.fresh != 0) == is_fresh) {
                let index = input.slot as usize;
                let (Some(feed), Some(topic)) = (feeds.get(index), self.slots.get(index)) else {
                    return Err(missing(format!("a call was handed a message in slot {index}")));
                };
                let recorded = past.window.find(topic, (input.sequence, input.stamp_ns));
                let message = (past.replayed)(topic, input.sequence).or_else(|| recorded.cloned());
                let message = message.ok_or_else(|| {
                    missing(format!("message {} on {topic} is not recorded", input.sequence))
                })?;
                feed.publish(&message.header, &message.items).map_err(HostError::from)?;
            }
            host.collect()?;
        }
        host.call(Time(header.stamp_ns))?;
        self.calls += 1;
        let mut published = Published::new();
        for (topic, message, tap) in taps {
            while let Some(sample) = tap.receive().map_err(HostError::from)? {
                published.push(RecordedMessage {
                    topic: topic.clone(),
                    message: *message,
                    header: sample.header().to_vec(),
                    items: sample.items().to_vec(),
                });
            }
        }
        Ok(published)
    }
}

/// Cause why an event cannot be repeated.
enum Failure {
    /// The recording lacks something; the replay of the behavior ends.
    Missing(String),
    /// The replay itself failed.
    Replay(ReplayError),
}

impl<E: Into<ReplayError>> From<E> for Failure {
    fn from(error: E) -> Failure {
        Failure::Replay(error.into())
    }
}
