//! One behavior of a live run again: the calls of its log, with the inputs that each was handed.

use std::rc::Rc;

use yamabico_core::message::{
    CallEvent, CallHeader, CallInput, MessageType, Proposal, RetuneHeader, RetuneStep, SavedStateHeader,
    View, state_hash,
};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawPublisher, RawSubscriber, TopicSpec};
use yamabico_host::{BehaviorHost, BehaviorPlan, HostError, topics};

use super::steps::{RecordedMessage, raw};
use super::window::Window;
use crate::execution::Plan;

/// Messages of a call: topic, type, header and items.
pub(super) type Published = Vec<RecordedMessage>;

/// A behavior under replay.
pub(super) struct BehaviorReplay {
    // Ports are dropped before the bus.
    host: Option<BehaviorHost>,
    feeds: Vec<RawPublisher>,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    bus: Bus,
    plan: BehaviorPlan,
    list_bytes: Vec<usize>,
    instances: u32,
    sequence: u64,
    /// Cause why the replay of this behavior has ended early.
    pub ended: Option<String>,
    /// Number of instances after the first, and of calls.
    pub restarts: u32,
    pub calls: u64,
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
    /// Prepares the replay of `behavior`, whose topics exist on `bus`.
    ///
    /// # Errors
    /// The bus fails.
    pub fn new(behavior: &BehaviorPlan, plan: &Plan, bus: &Bus) -> Result<BehaviorReplay, BusError> {
        let name = &behavior.setup.name;
        let outputs = behavior.factory.info().outputs.iter();
        let outputs = outputs.map(|slot| (topics::output(name, &slot.name), slot.message));
        let taps = outputs
            .chain([(topics::proposal(name), MessageType::of::<Proposal>())])
            .map(|(topic, message)| Ok((topic.clone(), message, bus.tap(&topic, &message)?)));
        let list_bytes = |topic: &str| {
            plan.topics.iter().find(|known| known.name == topic).map_or(0, |known| known.spec.list_bytes)
        };
        Ok(BehaviorReplay {
            host: None,
            feeds: Vec::new(),
            taps: taps.collect::<Result<_, BusError>>()?,
            bus: bus.clone(),
            list_bytes: behavior.inputs.iter().map(|(_, topic, _)| list_bytes(topic)).collect(),
            plan: behavior.clone(),
            instances: 0,
            sequence: 0,
            ended: None,
            restarts: 0,
            calls: 0,
        })
    }

    /// Name of the behavior.
    pub fn name(&self) -> &str {
        &self.plan.setup.name
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
    ) -> Result<Published, HostError> {
        if self.ended.is_some() {
            return Ok(Published::new());
        }
        let is_start = header.event() == Some(CallEvent::Start);
        if !is_start && header.sequence != self.sequence + 1 {
            self.end(header, "the log of its calls has a gap".to_owned());
            return Ok(Published::new());
        }
        self.sequence = header.sequence;
        let outcome = match header.event() {
            Some(CallEvent::Start) => self.start(header, past).map(|()| Published::new()),
            Some(CallEvent::Retune) => self.retune(header, past).map(|()| Published::new()),
            Some(CallEvent::Call) => self.call(header, inputs, past),
            None => Err(Failure::Missing("an event of an unknown kind is logged".to_owned())),
        };
        match outcome {
            Ok(published) => Ok(published),
            Err(Failure::Missing(what)) => {
                self.end(header, what);
                Ok(Published::new())
            }
            Err(Failure::Host(error)) => Err(error),
        }
    }

    fn end(&mut self, header: &CallHeader, what: String) {
        self.host = None;
        let time_s = Time(header.stamp_ns).as_secs_f64();
        self.ended =
            Some(format!("{} is replayed up to {time_s:.3} s (stamp): {what}", self.plan.setup.name));
    }

    fn start(&mut self, header: &CallHeader, past: &Past<'_>) -> Result<(), Failure> {
        self.host = None;
        self.feeds.clear();
        self.restarts += u32::from(self.instances > 0);
        self.instances += 1;
        let name = &self.plan.setup.name;
        let mut plan = self.plan.clone();
        for ((slot, topic, message), list_bytes) in plan.inputs.iter_mut().zip(&self.list_bytes) {
            // New topics for each instance: nothing that an earlier one was handed comes again by itself.
            *topic = format!("replay/{name}/{}/{slot}", self.instances);
            let spec = TopicSpec { list_bytes: *list_bytes, subscribers: 4, ..TopicSpec::default() };
            self.bus.create_raw(topic, message, &spec).map_err(HostError::from)?;
            self.feeds.push(self.bus.publisher_raw(topic, message).map_err(HostError::from)?);
        }
        let mut host = BehaviorHost::open(plan, &self.bus)?;
        if header.state != 0 {
            let state = past.kept.iter().rev().find_map(|message| {
                let view = View::<SavedStateHeader>::of(raw(message))?;
                let is_it = view.header.plugin.as_str() == name && state_hash(view.items) == header.state;
                is_it.then_some(view.items)
            });
            let missing =
                || Failure::Missing("the state that it was restarted with is not recorded".to_owned());
            host.restore_state(state.ok_or_else(missing)?);
        }
        self.host = Some(host);
        Ok(())
    }

    fn retune(&mut self, header: &CallHeader, past: &Past<'_>) -> Result<(), Failure> {
        let name = &self.plan.setup.name;
        let text = past.kept.iter().rev().find_map(|message| {
            let view = View::<RetuneHeader>::of(raw(message))?;
            let is_it = view.header.request == header.request
                && view.header.behavior.as_str() == name
                && view.header.step() != Some(RetuneStep::Drop);
            is_it.then(|| String::from_utf8_lossy(view.items).into_owned())
        });
        let missing = |what: &str| Failure::Missing(what.to_owned());
        let text = text.ok_or_else(|| missing("its new parameters are not recorded"))?;
        let table: toml::Table = text.parse().map_err(|_| missing("its new parameters are not valid"))?;
        self.plan.table = table.clone();
        match &mut self.host {
            Some(host) => Ok(host.retune(table, &self.bus)?),
            None => Err(missing("its start is not recorded")),
        }
    }

    fn call(
        &mut self,
        header: &CallHeader,
        inputs: &[CallInput],
        past: &Past<'_>,
    ) -> Result<Published, Failure> {
        let missing = |what: String| Failure::Missing(what);
        let Some(host) = &mut self.host else {
            return Err(missing("its start is not recorded".to_owned()));
        };
        if header.left_out > 0 {
            return Err(missing(format!("{} inputs of a call are not logged", header.left_out)));
        }
        // What had been received before the call is received again before its fresh inputs.
        for is_fresh in [false, true] {
            for input in inputs.iter().filter(|input| (input.fresh != 0) == is_fresh) {
                let index = input.slot as usize;
                let (Some(feed), Some((_, topic, _))) = (self.feeds.get(index), self.plan.inputs.get(index))
                else {
                    return Err(missing(format!("a call was handed a message in slot {index}")));
                };
                let recorded = past.window.find(topic, (input.sequence, input.stamp_ns));
                let message = (past.replayed)(topic, input.sequence).or_else(|| recorded.cloned());
                let message = message.ok_or_else(|| {
                    missing(format!("message {} on {topic} is not recorded", input.sequence))
                })?;
                feed.publish(&message.header, &message.items).map_err(HostError::from)?;
            }
            host.collect().map_err(HostError::from)?;
        }
        host.call(Time(header.stamp_ns)).map_err(HostError::from)?;
        self.calls += 1;
        let mut published = Published::new();
        for (topic, message, tap) in &self.taps {
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
    Host(HostError),
}

impl From<HostError> for Failure {
    fn from(error: HostError) -> Failure {
        Failure::Host(error)
    }
}
