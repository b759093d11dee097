//! Host of one behavior: collects its inputs, calls it when it is due, stamps and publishes its proposal.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use crate::BehaviorSettings;
use crate::bus::{Bus, BusError, Publisher, Subscriber, WaitSet};
use crate::call_log::CallLog;
use crate::error::HostError;
use crate::histogram::DurationHistogram;
use crate::input_ports::InputPorts;
use crate::output_ports::OutputPorts;
use crate::overlay_port::OverlayPort;
use crate::topics;
use yamabico_core::behavior::{
    Behavior, BehaviorFactory, Inputs, MAX_SAVED_STATE_BYTES, Outputs, ParameterError, Setup,
};
use yamabico_core::message::{
    DecisionHeader, Kind, MessageType, Name, Outcome, Proposal, SavedStateHeader, Verdict, state_hash,
};
use yamabico_core::time::{Time, TimeSource};

/// Panics after which a behavior is no longer rebuilt.
const MAX_PANICS: u32 = 5;

/// Everything that is needed to host a behavior.
#[derive(Clone, Debug)]
pub struct BehaviorPlan {
    /// Plugin that builds it.
    pub factory: Arc<dyn BehaviorFactory>,
    /// Parameters of the behavior.
    pub table: toml::Table,
    /// Description of the robot and of its sensors, for the behavior's constructor.
    pub setup: Setup,
    /// Slot, topic and type of each input.
    pub inputs: Vec<(String, String, MessageType)>,
    /// Settings that the framework applies.
    pub settings: BehaviorSettings,
}

impl BehaviorPlan {
    /// Opens a wait set for the behavior's inputs, and for the decisions that wake it if it may sleep. Otherwise a decision
    /// does not wake the behavior: its proposal would cause the next decision, without end.
    ///
    /// # Errors
    /// Topics that do not notify.
    pub fn wait_set(&self, bus: &Bus) -> Result<WaitSet, BusError> {
        let inputs = self.inputs.iter().map(|(_, topic, _)| topic.as_str());
        let inputs = inputs.filter(|&topic| topic != topics::DECISION);
        let decisions = self.settings.sleeps_while_inhibited.then_some(topics::DECISION);
        bus.wait_set(&inputs.chain(decisions).collect::<Vec<_>>())
    }
}

/// Statistics of a behavior's calls. They are measured by the wall clock and never enter a decision.
#[derive(Clone, Debug, Default)]
pub struct CallStats {
    /// Computing time of each call.
    pub calls: DurationHistogram,
    /// Number of calls that took longer than the budget.
    pub overruns: u64,
    /// Number of calls that proposed nothing.
    pub abstentions: u64,
    /// Number of calls that panicked.
    pub panics: u32,
}

/// A behavior with its inputs and outputs on the bus.
pub struct BehaviorHost {
    pub(super) plan: BehaviorPlan,
    /// None after too many panics.
    pub(super) behavior: Option<Box<dyn Behavior>>,
    pub(super) inputs: InputPorts,
    /// Decisions on the bus, for a behavior that sleeps while it is inhibited.
    decisions: Option<Subscriber<DecisionHeader>>,
    sleeps: bool,
    outputs: OutputPorts,
    overlay: OverlayPort,
    proposals: Publisher<Proposal>,
    name: Name,
    sequence: u64,
    has_new_input: bool,
    last_call: Option<Time>,
    time: TimeSource,
    stats: CallStats,
    /// State that the behavior saved after its last call.
    pub(super) saved_state: Vec<u8>,
    /// Hash of the restored state; zero if none was.
    restored: u64,
    /// Request of the parameters that it was started with; zero for those of the task file.
    request: u64,
    /// Publisher of its saved state in lockstep, with the state that was published last.
    states: Option<(Publisher<SavedStateHeader>, Vec<u8>, u64)>,
    /// Log of the calls of a live run.
    calls: Option<CallLog>,
    /// Set after the first call since the behavior was built that did not panic.
    survived_a_call: bool,
}

impl BehaviorHost {
    /// Builds the behavior and opens its topics.
    ///
    /// # Errors
    /// Parameters that the behavior rejects, or topics that cannot be opened.
    pub fn open(plan: BehaviorPlan, bus: &Bus) -> Result<BehaviorHost, HostError> {
        let instance = &plan.setup.name;
        let outputs: Vec<_> = plan
            .factory
            .info()
            .outputs
            .iter()
            .map(|slot| (slot.name.to_string(), topics::output(instance, &slot.name), slot.message))
            .collect();
        let may_sleep = plan.settings.sleeps_while_inhibited;
        Ok(BehaviorHost {
            behavior: Some(plan.factory.build(&plan.table, &plan.setup)?),
            inputs: InputPorts::open(bus, &plan.inputs)?,
            decisions: may_sleep.then(|| bus.subscriber(topics::DECISION)).transpose()?,
            sleeps: false,
            outputs: OutputPorts::open(bus, &outputs)?,
            overlay: OverlayPort::open(bus, instance, &plan.inputs)?,
            proposals: bus.publisher(&topics::proposal(instance))?,
            name: Name::new(instance),
            sequence: 0,
            has_new_input: false,
            last_call: None,
            time: TimeSource::Step,
            stats: CallStats::default(),
            saved_state: Vec::new(),
            restored: 0,
            request: 0,
            states: None,
            calls: None,
            survived_a_call: false,
            plan,
        })
    }

    /// Name in the task file.
    pub fn name(&self) -> &str {
        &self.plan.setup.name
    }

    /// Sets the clock that stamps the end of each call; without one the time stands still within a step.
    pub fn set_time_source(&mut self, time: TimeSource) {
        self.time = time;
    }

    /// Statistics of the calls so far.
    pub fn stats(&self) -> &CallStats {
        &self.stats
    }

    /// State that the behavior saved after its last call, JSON; empty if it saves none.
    pub fn saved_state(&self) -> &[u8] {
        &self.saved_state
    }

    /// Restores the state that an earlier instance of the behavior saved.
    pub fn restore_state(&mut self, state: &[u8]) {
        if let Some(behavior) = &mut self.behavior {
            behavior.restore_state(state);
            self.restored = state_hash(state);
        }
    }

    /// Sets the request of the parameters that the behavior was started with, for the log of its calls.
    pub(super) fn set_request(&mut self, request: u64) {
        self.request = request;
    }

    /// Continues the count of an earlier instance, whose last proposal had this number, for a replay from the middle of a run.
    pub fn resume(&mut self, sequence: u64) {
        self.sequence = sequence;
    }

    /// Publishes the saved state after each call that changes it, on [`topics::SAVED_STATES`].
    ///
    /// # Errors
    /// The topic does not exist.
    pub fn publish_states(&mut self, bus: &Bus) -> Result<(), BusError> {
        self.states = Some((bus.publisher(topics::SAVED_STATES)?, Vec::new(), 0));
        Ok(())
    }

    /// Logs every call from now on, so that the run can be replayed, if the run has a topic for that.
    pub(super) fn log_calls(&mut self, bus: &Bus) {
        self.calls = CallLog::open(bus, &self.plan.setup.name, (self.restored, self.request));
    }

    /// Log of the calls, if the run is logged.
    pub(super) fn call_log(&mut self) -> Option<&mut CallLog> {
        self.calls.as_mut()
    }

    /// Replaces the behavior by one with the parameters `table`, as a change of parameters during a run does.
    ///
    /// # Errors
    /// The constructor rejects the parameters, or the inputs cannot be reopened.
    pub fn retune(&mut self, table: toml::Table, bus: &Bus) -> Result<(), HostError> {
        let candidate = self.build(table)?;
        Ok(self.replace(candidate, bus)?)
    }

    /// Receives every waiting input, and the newest decision.
    ///
    /// # Errors
    /// The bus failed.
    pub fn collect(&mut self) -> Result<(), BusError> {
        self.has_new_input |= self.inputs.collect()?;
        let Some(decisions) = &self.decisions else { return Ok(()) };
        if let Some(decision) = decisions.newest()? {
            let mut verdicts = decision.items().iter();
            let own = verdicts.find(|verdict| verdict.behavior == self.name);
            self.sleeps = own.and_then(Verdict::outcome) == Some(Outcome::Inhibited);
        }
        Ok(())
    }

    /// Returns true if the behavior is inhibited and therefore not called.
    pub fn sleeps(&self) -> bool {
        self.sleeps
    }

    /// Time of the next periodic call; none for a behavior without a period, asleep, or out after too many panics.
    pub fn next_call(&self) -> Option<Time> {
        let period = self.plan.settings.period.filter(|_| self.behavior.is_some() && !self.sleeps)?;
        Some(self.last_call.map_or(Time::ZERO, |last| last + period))
    }

    /// Calls the behavior if it has new input or its period is over, and publishes its proposal. A behavior that panics
    /// publishes nothing and is rebuilt.
    ///
    /// # Errors
    /// The bus failed.
    pub fn propose(&mut self, now: Time) -> Result<(), BusError> {
        let due = !self.sleeps && (self.has_new_input || self.next_call().is_some_and(|at| at <= now));
        if due { self.call(now) } else { Ok(()) }
    }

    /// Calls the behavior, whether it is due or not, and publishes its proposal; otherwise like
    /// [`BehaviorHost::propose`].
    ///
    /// # Errors
    /// The bus failed.
    pub fn call(&mut self, now: Time) -> Result<(), BusError> {
        let Some(behavior) = &mut self.behavior else { return Ok(()) };
        let started = Instant::now();
        let (inputs, outputs, state) = (&self.inputs, &mut self.outputs, &mut self.saved_state);
        let canvas = self.overlay.canvas(now);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut outputs = Outputs::new(outputs).with_overlay(canvas);
            let proposal = behavior.propose(&Inputs::new(now, inputs), &mut outputs);
            state.clear();
            behavior.save_state(state);
            proposal
        }));
        let took = started.elapsed();
        self.stats.calls.add(took);
        self.stats.overruns += u64::from(self.plan.settings.budget.is_some_and(|budget| took > budget));
        self.has_new_input = false;
        self.last_call = Some(now);
        let evidence_ns = self.inputs.evidence_ns().unwrap_or(now.0);
        let (outcome, proposal) = match outcome {
            Ok(proposal) => {
                self.survived_a_call = true;
                let published = self.publish(proposal, now, evidence_ns);
                (published.and_then(|()| self.overlay.publish()), self.sequence)
            }
            Err(_) => {
                self.rebuild();
                (Ok(()), 0)
            }
        };
        if let Some(calls) = &mut self.calls {
            calls.called(&self.inputs, now, proposal);
        }
        outcome.and_then(|()| self.publish_state(now))
    }

    fn publish_state(&mut self, now: Time) -> Result<(), BusError> {
        let Some((publisher, published, sequence)) = &mut self.states else { return Ok(()) };
        let state = &self.saved_state;
        if state == published || state.len() > MAX_SAVED_STATE_BYTES {
            return Ok(());
        }
        published.clone_from(state);
        *sequence += 1;
        publisher
            .publish(&SavedStateHeader { stamp_ns: now.0, sequence: *sequence, plugin: self.name }, state)
    }

    fn publish(&mut self, mut proposal: Proposal, now: Time, evidence_ns: u64) -> Result<(), BusError> {
        self.stats.abstentions += u64::from(proposal.kind() == Some(Kind::Abstain));
        self.sequence += 1;
        proposal.behavior = self.name;
        proposal.sequence = self.sequence;
        proposal.priority = self.plan.settings.priority;
        if proposal.stamp_ns == 0 {
            proposal.stamp_ns = now.0;
        }
        if proposal.evidence_ns == 0 {
            proposal.evidence_ns = evidence_ns;
        }
        proposal.received_ns = now.0;
        proposal.proposed_ns = self.time.now(now).0;
        self.proposals.publish(&proposal, &[])
    }

    /// Replaces a behavior that panicked by a new instance, unless it panicked too often or cannot be built.
    pub(super) fn rebuild(&mut self) {
        self.stats.panics += 1;
        let (plan, panics, state) = (&self.plan, self.stats.panics, &self.saved_state);
        // After a panic in the very first call the saved state may be the cause: discard it.
        let restores = std::mem::take(&mut self.survived_a_call) && !state.is_empty();
        let old = self.behavior.take();
        let rebuilt = catch_unwind(AssertUnwindSafe(|| {
            drop(old);
            let new = (panics < MAX_PANICS).then(|| plan.factory.build(&plan.table, &plan.setup));
            let mut new = new.transpose()?;
            if let Some(new) = new.as_mut().filter(|_| restores) {
                new.restore_state(state);
            }
            Ok::<_, ParameterError>(new)
        }));
        let name = &plan.setup.name;
        self.behavior = match rebuilt {
            Ok(Ok(Some(new))) => {
                tracing::error!("behavior `{name}` panicked and was rebuilt");
                Some(new)
            }
            Ok(Ok(None)) => {
                tracing::error!("behavior `{name}` panicked {panics} times and is disabled");
                None
            }
            Ok(Err(error)) => {
                tracing::error!("behavior `{name}` panicked, cannot be rebuilt and is disabled: {error}");
                None
            }
            Err(_) => {
                tracing::error!(
                    "behavior `{name}` panicked, panicked again during the rebuild, and is disabled"
                );
                None
            }
        };
    }
}

#[cfg(test)]
mod tests;
