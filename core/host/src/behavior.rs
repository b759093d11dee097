//! A behavior at work: fed from the bus, asked when something is new, its proposal signed and sent.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::bus::{Bus, BusError, Publisher, Subscriber, Waiter};
use crate::config::Isolation;
use yamabico_core::behavior::{Behavior, BehaviorFactory, BuildError, Inputs, Outputs, Setup};
use yamabico_core::message::{DecisionHeader, Kind, MessageType, Name, Outcome, Proposal, Verdict};
use yamabico_core::time::{Time, TimeSource};

use super::durations::Durations;
use super::feed::Feed;
use super::ports::Ports;
use super::scheduling::Scheduling;
use super::topics;

/// After so many panics a behavior stays out.
const MAX_PANICS: u32 = 5;

/// Everything needed to seat a behavior.
#[derive(Clone, Debug)]
pub struct BehaviorPlan {
    /// What it is.
    pub factory: Arc<dyn BehaviorFactory>,
    /// Its parameters.
    pub table: toml::Table,
    /// What it is told about itself and the robot.
    pub setup: Setup,
    /// Higher wins.
    pub priority: i32,
    /// Slot, topic and type of each input.
    pub inputs: Vec<(String, String, MessageType)>,
    /// Asked at least this often, new input or not.
    pub period: Option<Duration>,
    /// Longer calls count as overruns.
    pub budget: Option<Duration>,
    /// Whether it is not asked while it is inhibited.
    pub sleeps: bool,
    /// Live: where it runs, and how long it may show no sign of life.
    pub hosting: Hosting,
    /// The program that it is, and its arguments; empty where it is a part of this one.
    pub exec: Vec<String>,
}

impl BehaviorPlan {
    /// Waits for what arrives in the behavior's slots, and where it may sleep, for what wakes it.
    ///
    /// # Errors
    /// Topics that do not ring.
    pub fn waiter(&self, bus: &Bus) -> Result<Waiter, BusError> {
        let inputs = self.inputs.iter().map(|(_, topic, _)| topic.as_str());
        bus.waiter(&inputs.chain(self.sleeps.then_some(topics::DECISION)).collect::<Vec<_>>())
    }
}

/// Where a plugin runs while the robot runs live, and when it hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hosting {
    /// In a process of its own or on a thread.
    pub isolation: Isolation,
    /// A process that shows no sign of life for longer hangs.
    pub patience: Duration,
    /// What is asked of the system's scheduler for it.
    pub scheduling: Scheduling,
}

/// How a behavior fared. Wall-clock figures: they never enter a decision.
#[derive(Clone, Debug, Default)]
pub struct BehaviorRecord {
    /// Of all calls.
    pub calls: Durations,
    /// Calls longer than the budget.
    pub overruns: u64,
    /// Calls that proposed nothing.
    pub abstentions: u64,
    /// Calls that panicked.
    pub panics: u32,
}

/// A behavior between its feed and its ports.
pub struct BehaviorSeat {
    pub(super) plan: BehaviorPlan,
    pub(super) behavior: Option<Box<dyn Behavior>>,
    pub(super) feed: Feed,
    /// Where it may sleep, what tells it whether to.
    decisions: Option<Subscriber<DecisionHeader>>,
    sleeps: bool,
    ports: Ports,
    proposals: Publisher<Proposal>,
    name: Name,
    sequence: u64,
    fresh: bool,
    last_call: Option<Time>,
    time: TimeSource,
    record: BehaviorRecord,
    /// What the behavior remembered after its last call.
    pub(super) memory: Vec<u8>,
    /// Whether it survived a call since it was built.
    survived: bool,
}

impl BehaviorSeat {
    /// Builds the behavior and opens its channels.
    ///
    /// # Errors
    /// Parameters that do not fit, or channels that do not open.
    pub fn open(plan: BehaviorPlan, bus: &Bus) -> Result<BehaviorSeat, SeatError> {
        let instance = &plan.setup.name;
        let outputs: Vec<_> = plan
            .factory
            .info()
            .outputs
            .iter()
            .map(|slot| (slot.name.to_string(), topics::output(instance, &slot.name), slot.message))
            .collect();
        Ok(BehaviorSeat {
            behavior: Some(plan.factory.build(&plan.table, &plan.setup)?),
            feed: Feed::open(bus, &plan.inputs)?,
            decisions: plan.sleeps.then(|| bus.subscriber(topics::DECISION)).transpose()?,
            sleeps: false,
            ports: Ports::open(bus, &outputs)?,
            proposals: bus.publisher(&topics::proposal(instance))?,
            name: Name::new(instance),
            sequence: 0,
            fresh: false,
            last_call: None,
            time: TimeSource::Step,
            record: BehaviorRecord::default(),
            memory: Vec::new(),
            survived: false,
            plan,
        })
    }

    /// Its name in the task file.
    pub fn name(&self) -> &str {
        &self.plan.setup.name
    }

    /// Stamps the stages of its proposals by `time`; without it, they stand still within a step.
    pub fn keep_time_by(&mut self, time: TimeSource) {
        self.time = time;
    }

    /// How it fared so far.
    pub fn record(&self) -> &BehaviorRecord {
        &self.record
    }

    /// What its successor must know, JSON.
    pub fn memory(&self) -> &[u8] {
        &self.memory
    }

    /// Lets the behavior go on where its predecessor, which remembered this, stopped.
    pub fn recall(&mut self, memory: &[u8]) {
        if let Some(behavior) = &mut self.behavior {
            behavior.recall(memory);
        }
    }

    /// Takes in what has arrived.
    ///
    /// # Errors
    /// The bus failed.
    pub fn collect(&mut self) -> Result<(), BusError> {
        self.fresh |= self.feed.collect()?;
        let Some(decisions) = &self.decisions else { return Ok(()) };
        if let Some(decision) = decisions.newest()? {
            let mut verdicts = decision.items().iter();
            let own = verdicts.find(|verdict| verdict.behavior == self.name);
            self.sleeps = own.and_then(Verdict::outcome) == Some(Outcome::Inhibited);
        }
        Ok(())
    }

    /// Whether it is inhibited and therefore not asked.
    pub fn sleeps(&self) -> bool {
        self.sleeps
    }

    /// When it wants to be asked though nothing is new; `None` where never, while it sleeps, or where it stays out.
    pub fn next_call(&self) -> Option<Time> {
        let period = self.plan.period.filter(|_| self.behavior.is_some() && !self.sleeps)?;
        Some(self.last_call.map_or(Time::ZERO, |last| last + period))
    }

    /// Asks the behavior where something is new or its period is over, and publishes its proposal. A panic is caught:
    /// the behavior falls silent for this call, as if it had died, and is built anew.
    ///
    /// # Errors
    /// The bus refused the proposal.
    pub fn propose(&mut self, now: Time) -> Result<(), BusError> {
        let due = !self.sleeps && (self.fresh || self.next_call().is_some_and(|at| at <= now));
        let Some(behavior) = self.behavior.as_mut().filter(|_| due) else { return Ok(()) };
        let started = Instant::now();
        let (feed, ports, memory) = (&self.feed, &mut self.ports, &mut self.memory);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let proposal = behavior.propose(&Inputs::new(now, feed), &mut Outputs::new(ports));
            memory.clear();
            behavior.remember(memory);
            proposal
        }));
        let took = started.elapsed();
        self.record.calls.add(took);
        self.record.overruns += u64::from(self.plan.budget.is_some_and(|budget| took > budget));
        self.fresh = false;
        self.last_call = Some(now);
        let evidence_ns = self.feed.evidence_ns().unwrap_or(now.0);
        match outcome {
            Ok(proposal) => {
                self.survived = true;
                self.publish(proposal, now, evidence_ns)
            }
            Err(_) => {
                self.start_anew();
                Ok(())
            }
        }
    }

    fn publish(&mut self, mut proposal: Proposal, now: Time, evidence_ns: u64) -> Result<(), BusError> {
        self.record.abstentions += u64::from(proposal.kind() == Some(Kind::Abstain));
        self.sequence += 1;
        proposal.behavior = self.name;
        proposal.sequence = self.sequence;
        proposal.priority = self.plan.priority;
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

    /// The new one goes on where the old one stopped, unless that panicked on its first call already: what it remembers may be
    /// what it cannot bear. Whatever goes wrong in taking down the old one or building the new one, the seat stays empty.
    pub(super) fn start_anew(&mut self) {
        self.record.panics += 1;
        let (plan, panics, memory) = (&self.plan, self.record.panics, &self.memory);
        let recalls = std::mem::take(&mut self.survived) && !memory.is_empty();
        let old = self.behavior.take();
        let rebuilt = catch_unwind(AssertUnwindSafe(|| {
            drop(old);
            let anew = (panics < MAX_PANICS).then(|| plan.factory.build(&plan.table, &plan.setup));
            let mut anew = anew.transpose()?;
            if let Some(anew) = anew.as_mut().filter(|_| recalls) {
                anew.recall(memory);
            }
            Ok::<_, BuildError>(anew)
        }));
        let name = &plan.setup.name;
        self.behavior = match rebuilt {
            Ok(Ok(Some(anew))) => {
                tracing::error!("behavior `{name}` panicked and is built anew");
                Some(anew)
            }
            Ok(Ok(None)) => {
                tracing::error!("behavior `{name}` panicked {panics} times and stays out");
                None
            }
            Ok(Err(error)) => {
                tracing::error!("behavior `{name}` panicked, cannot be built anew and stays out: {error}");
                None
            }
            Err(_) => {
                tracing::error!("behavior `{name}` panicked, again while it was built anew, and stays out");
                None
            }
        };
    }
}

/// A behavior or a device that could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum SeatError {
    /// The parameters of a behavior do not fit.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A device does not open.
    #[error("device `{device}` does not open: {reason}")]
    Device {
        /// Its name in the robot file.
        device: String,
        /// Why.
        reason: BuildError,
    },
    /// The channels do not open.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Its process cannot be started, or did not come up.
    #[error("the process of `{name}` does not come up: {reason}")]
    Process {
        /// Whose.
        name: String,
        /// What happened and what to do.
        reason: String,
    },
    /// A thread does not start.
    #[error("cannot start the thread of `{name}`: {source}; end other programs or raise `ulimit -u`")]
    Thread {
        /// Whose.
        name: String,
        /// What the system said.
        source: std::io::Error,
    },
}

#[cfg(test)]
mod tests;
