//! Decisions of a running robot, with the context that explains them.

use std::time::{Duration, Instant};

use yamabico_arbiter::decide::{DecisionMessage, ExplainContext};
use yamabico_core::message::{DecisionHeader, ProcessesHeader, Proposal};
use yamabico_host::bus::{Bus, BusError, Subscriber, WaitSet};

use super::{ClientError, RobotClient};
use crate::execution::{RobotManifest, topics};

/// Time within which a running robot decides.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Receives decisions, and the proposals and process reports behind them.
pub(super) struct DecisionObserver {
    wait_set: WaitSet,
    decisions: Subscriber<DecisionHeader>,
    proposals: Vec<Subscriber<Proposal>>,
    processes: Subscriber<ProcessesHeader>,
    /// Set if the supervisor reports on processes.
    has_processes: bool,
    pub context: ExplainContext,
}

impl RobotClient {
    /// Newest decision that was not returned yet, waited for up to `timeout`; `None` if there is none in time.
    ///
    /// # Errors
    /// The robot publishes no manifest, or the bus fails.
    pub fn latest_decision(&mut self, timeout: Duration) -> Result<Option<DecisionMessage>, ClientError> {
        Ok(self.observer()?.latest(timeout)?)
    }

    /// Newest decision, after every behavior and the supervisor have had up to `time` to publish once, so that
    /// [`RobotClient::context`] is complete.
    ///
    /// # Errors
    /// The robot publishes no manifest or no decision, or the bus fails.
    pub fn decision_in_context(&mut self, time: Duration) -> Result<DecisionMessage, ClientError> {
        let observer = self.observer()?;
        let began = Instant::now();
        let mut newest = observer.latest(TIMEOUT)?.ok_or(ClientError::NoDecision)?;
        while let Some(left) = time.checked_sub(began.elapsed())
            && !observer.is_complete()
        {
            newest = observer.latest(left)?.unwrap_or(newest);
        }
        Ok(newest)
    }

    /// Context of the decision returned last, for [`explain`](yamabico_arbiter::decide::explain).
    pub fn context(&self) -> ExplainContext {
        self.observer.as_ref().map(|observer| observer.context.clone()).unwrap_or_default()
    }

    pub(super) fn observer(&mut self) -> Result<&mut DecisionObserver, ClientError> {
        if self.observer.is_none() {
            let bus = self.bus.clone();
            self.observer = Some(DecisionObserver::open(&bus, self.manifest()?)?);
        }
        self.observer.as_mut().ok_or(ClientError::NoDecision)
    }
}

impl DecisionObserver {
    fn open(bus: &Bus, manifest: &RobotManifest) -> Result<DecisionObserver, BusError> {
        let behaviors = manifest.plugins.iter().filter(|plugin| plugin.behavior.is_some());
        let proposals = behaviors.map(|plugin| bus.subscriber(&topics::proposal(&plugin.name)));
        Ok(DecisionObserver {
            wait_set: bus.wait_set(&[topics::DECISION])?,
            decisions: bus.subscriber(topics::DECISION)?,
            proposals: proposals.collect::<Result<_, _>>()?,
            processes: bus.subscriber(topics::PROCESSES)?,
            has_processes: manifest.plugins.iter().any(|plugin| plugin.own_process),
            context: ExplainContext { terms: manifest.terms(), ..ExplainContext::default() },
        })
    }

    pub fn latest(&mut self, timeout: Duration) -> Result<Option<DecisionMessage>, BusError> {
        let began = Instant::now();
        loop {
            if let Some(decision) = self.receive()? {
                return Ok(Some(decision));
            }
            let Some(left) = timeout.checked_sub(began.elapsed()) else { return Ok(None) };
            self.wait_set.wait(left)?;
        }
    }

    /// Returns true if a proposal of each behavior and the supervisor's report have been received.
    fn is_complete(&self) -> bool {
        self.context.proposals.len() >= self.proposals.len()
            && !(self.has_processes && self.context.processes.is_empty())
    }

    fn receive(&mut self) -> Result<Option<DecisionMessage>, BusError> {
        let decision = self.decisions.newest()?;
        let decision = decision
            .map(|newest| DecisionMessage { header: *newest.header(), verdicts: newest.items().to_vec() });
        for subscriber in &self.proposals {
            let Some(proposal) = subscriber.newest()?.map(|proposal| *proposal.header()) else { continue };
            match self.context.proposals.iter_mut().find(|known| known.behavior == proposal.behavior) {
                Some(known) => *known = proposal,
                None => self.context.proposals.push(proposal),
            }
        }
        if let Some(processes) = self.processes.newest()? {
            self.context.processes = processes.items().to_vec();
        }
        Ok(decision)
    }
}
