//! The arbiter without its ports: what it hears, its decision, and the messages that follow.

use std::collections::BTreeMap;

use yamabico_core::message::{Command, Control, ControlKind, DecisionHeader, Goal, Proposal, Verdict};
use yamabico_core::time::Time;

use crate::report::{Latency, LatencyFigures};
use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
use yamabico_arbiter::policy::Policy;

/// Maximum number of things heard in one record; a decision that heard more cannot be replayed.
pub const MAX_HEARD: usize = 256;

/// The arbiter without its ports. A run and a replay of it make the same calls.
pub(crate) struct ArbiterCore {
    pub policy: Policy,
    state: ArbiterState,
    decision: Decision,
    proposals: Vec<Option<Proposal>>,
    /// Time at which each proposal was received, and whether a command has used it.
    received: Vec<(Time, Novelty)>,
    latencies: Vec<Latency>,
    verdicts: Vec<Verdict>,
}

/// State of a proposal: used by a command or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Novelty {
    New,
    Used,
}

impl ArbiterCore {
    /// An arbiter that has heard nothing.
    pub fn new(policy: Policy) -> ArbiterCore {
        let behaviors = policy.behaviors.len();
        ArbiterCore {
            state: ArbiterState::new(&policy),
            decision: Decision::new(&policy),
            proposals: vec![None; behaviors],
            received: vec![(Time::ZERO, Novelty::Used); behaviors],
            latencies: vec![Latency::default(); behaviors],
            verdicts: vec![Verdict::default(); behaviors],
            policy,
        }
    }

    /// Hears the newest proposal of the behavior with this index.
    pub fn hear_proposal(&mut self, index: usize, proposal: Proposal, at: Time) {
        if let (Some(slot), Some(received)) = (self.proposals.get_mut(index), self.received.get_mut(index)) {
            *slot = Some(proposal);
            *received = (at, Novelty::New);
        }
    }

    /// Hears that the critical sensor with this index measured at `stamp`.
    pub fn hear_sensor(&mut self, index: usize, stamp: Time) {
        self.state.sensor_measured(index, stamp);
    }

    /// Carries out the request of an operator; returns a goal to publish.
    pub fn hear_control(&mut self, control: &Control, now: Time) -> Option<Goal> {
        let target = self.policy.find(control.target.as_str());
        match (control.kind(), target) {
            (Some(ControlKind::EmergencyStop), _) => self.state.emergency_stop(),
            (Some(ControlKind::Reset), _) => self.state.reset(),
            (Some(ControlKind::Enable), Some(index)) => self.state.enable(index),
            (Some(ControlKind::Disable), Some(index)) => self.state.disable(index),
            (Some(ControlKind::Goal), _) if is_goal(control.goal) => {
                let [x, y, theta, tolerance_m] = control.goal;
                let (stamp_ns, sequence) = (now.0, control.sequence);
                return Some(Goal { stamp_ns, sequence, x, y, theta, tolerance_m });
            }
            // Parameter updates have a server of their own.
            (Some(ControlKind::Retune), _) => {}
            _ => tracing::warn!("refused an invalid request: {control:?}"),
        }
        None
    }

    /// Latches the emergency stop.
    pub fn emergency_stop(&mut self) {
        self.state.emergency_stop();
    }

    /// Brings the robot to a standstill for the end of the run.
    pub fn shut_down(&mut self) {
        self.state.shut_down();
    }

    /// Decides from what was heard.
    pub fn decide(&mut self, now: Time) {
        decide(&self.policy, &mut self.state, &self.proposals, now, &mut self.decision);
    }

    /// Command sent at `sent`, with the times of its stages from the proposal with the oldest data.
    pub fn command(&self, sent: Time) -> Command {
        let command = self.decision.command(&self.policy);
        let oldest = self.decision.evidence_of.map(usize::from);
        let staged = oldest.and_then(|i| Some((self.proposals.get(i)?.as_ref()?, self.received.get(i)?.0)));
        let sent_ns = sent.0;
        match staged {
            Some((proposal, received)) => Command {
                received_ns: proposal.received_ns,
                proposed_ns: proposal.proposed_ns,
                accepted_ns: received.0,
                sent_ns,
                ..command
            },
            None => Command { sent_ns, ..command },
        }
    }

    /// Decision with its verdicts.
    pub fn message(&mut self) -> (DecisionHeader, &[Verdict]) {
        let count = self.decision.write_verdicts(&self.policy, &mut self.verdicts);
        (self.decision.header(&self.policy), &self.verdicts[..count])
    }

    /// Counts the latencies of proposals that the command sent at `sent` is the first to use, and a late command.
    pub fn count(&mut self, sent: Time) {
        let proposals = self.proposals.iter().zip(&mut self.received).zip(&mut self.latencies);
        for ((proposal, (received, novelty)), latency) in proposals {
            if std::mem::replace(novelty, Novelty::Used) == Novelty::New
                && let Some(proposal) = proposal
            {
                latency.add(proposal, *received, sent);
            }
        }
        if let Some(latency) =
            self.decision.late.and_then(|late| self.latencies.get_mut(usize::from(late.behavior)))
        {
            latency.add_late();
        }
    }

    /// Latencies of each behavior's proposals, by name.
    pub fn latencies(&self) -> BTreeMap<String, LatencyFigures> {
        let behaviors = self.policy.behaviors.iter().zip(&self.latencies);
        behaviors
            .map(|(behavior, latency)| {
                (behavior.name.as_str().to_owned(), latency.figures(behavior.latency_budget))
            })
            .collect()
    }
}

/// Returns true if x, y, theta (NaN for any heading) and tolerance make a goal.
fn is_goal([x, y, theta, tolerance_m]: [f64; 4]) -> bool {
    x.is_finite() && y.is_finite() && !theta.is_infinite() && tolerance_m.is_finite() && tolerance_m > 0.0
}
