//! The arbiter of a run: receives proposals, publishes decisions and commands.

use std::collections::BTreeMap;

use yamabico_core::message::{
    Command, Control, ControlKind, DecisionHeader, Goal, MessageType, Proposal, Verdict,
};
use yamabico_core::time::{Time, TimeSource};
use yamabico_host::bus::{Bus, BusError, Publisher, RawSubscriber, Subscriber};

use super::plan::Plan;
use crate::report::{Latency, LatencyFigures};
use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
use yamabico_arbiter::policy::Policy;
use yamabico_host::topics;

/// The arbiter between proposals and commands. It alone holds the publisher of commands.
pub(super) struct ArbiterHost {
    policy: Policy,
    state: ArbiterState,
    decision: Decision,
    proposals: Vec<Option<Proposal>>,
    /// Time at which each proposal was received, and whether a command has used it.
    received: Vec<(Time, Novelty)>,
    latencies: Vec<Latency>,
    time: TimeSource,
    incoming: Vec<Subscriber<Proposal>>,
    sensors: Vec<(RawSubscriber, MessageType)>,
    controls: Subscriber<Control>,
    goals: Publisher<Goal>,
    commands: Publisher<Command>,
    decisions: Publisher<DecisionHeader>,
    verdicts: Vec<Verdict>,
    /// Set once a decision could not be published.
    has_failed_to_publish: bool,
}

/// State of a proposal: used by a command or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Novelty {
    New,
    Used,
}

impl ArbiterHost {
    /// Opens the arbiter's topics, the command topic first, so that no other process can publish on it.
    ///
    /// # Errors
    /// The bus fails.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ArbiterHost, BusError> {
        let policy = plan.policy.clone();
        let commands = bus.publisher(topics::COMMAND)?;
        let incoming =
            policy.behaviors.iter().map(|behavior| bus.subscriber(&topics::proposal(behavior.name.as_str())));
        let sensors = policy.sensors.iter().filter_map(|sensor| {
            let name = topics::sensor(sensor.name.as_str());
            let message = plan.topics.iter().find(|topic| topic.name == name)?.message;
            Some(bus.subscriber_raw(&name, &message).map(|subscriber| (subscriber, message)))
        });
        Ok(ArbiterHost {
            state: ArbiterState::new(&policy),
            decision: Decision::new(&policy),
            proposals: vec![None; policy.behaviors.len()],
            received: vec![(Time::ZERO, Novelty::Used); policy.behaviors.len()],
            latencies: vec![Latency::default(); policy.behaviors.len()],
            time: TimeSource::Step,
            incoming: incoming.collect::<Result<_, _>>()?,
            sensors: sensors.collect::<Result<_, _>>()?,
            controls: bus.subscriber(topics::CONTROL)?,
            goals: bus.publisher(topics::GOAL)?,
            commands,
            decisions: bus.publisher(topics::DECISION)?,
            verdicts: vec![Verdict::default(); policy.behaviors.len()],
            has_failed_to_publish: false,
            policy,
        })
    }

    /// Receives, decides, and publishes the command and the decision.
    ///
    /// If the bus does not deliver proposals, they count as silent, which stops the robot; if it does not deliver requests,
    /// the robot makes an emergency stop. A decision that cannot be published is logged once.
    ///
    /// # Errors
    /// The command cannot be published.
    pub fn step(&mut self, now: Time) -> Result<(), BusError> {
        self.receive(now);
        // Not earlier than anything received.
        let now = self.time.now(now);
        decide(&self.policy, &mut self.state, &self.proposals, now, &mut self.decision);
        let command = self.command(now);
        self.commands.publish(&command, &[])?;
        self.count(Time(command.sent_ns));
        let count = self.decision.write_verdicts(&self.policy, &mut self.verdicts);
        let published = self.decisions.publish(&self.decision.header(&self.policy), &self.verdicts[..count]);
        if let Err(error) = published
            && !std::mem::replace(&mut self.has_failed_to_publish, true)
        {
            tracing::error!("could not publish decisions: {error}");
        }
        Ok(())
    }

    /// Command with the times of its stages, from the proposal with the oldest data.
    fn command(&self, now: Time) -> Command {
        let command = self.decision.command(&self.policy);
        let oldest = self.decision.evidence_of.map(usize::from);
        let staged = oldest.and_then(|i| Some((self.proposals.get(i)?.as_ref()?, self.received.get(i)?.0)));
        let sent_ns = self.time.now(now).0;
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

    /// Counts the latencies of proposals that the command sent at `sent` is the first to use, and a late command.
    fn count(&mut self, sent: Time) {
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

    fn receive(&mut self, step: Time) {
        for ((slot, received), incoming) in
            self.proposals.iter_mut().zip(&mut self.received).zip(&self.incoming)
        {
            if let Ok(Some(newest)) = incoming.newest() {
                *slot = Some(*newest.header());
                *received = (self.time.now(step), Novelty::New);
            }
        }
        for (index, (sensor, message)) in self.sensors.iter().enumerate() {
            if let Ok(Some(newest)) = sensor.newest() {
                self.state.sensor_measured(index, (message.stamps)(newest.header()).0);
            }
        }
        if let Err(error) = self.goals.resend_to_new_subscribers() {
            tracing::error!("could not resend the goal to new subscribers: {error}");
        }
        loop {
            let control = self.controls.receive();
            match control.map(|control| control.map(|control| *control.header())) {
                Ok(Some(control)) => self.carry_out(&control, self.time.now(step)),
                Ok(None) => break,
                Err(error) => {
                    // The lost request may have been an emergency stop.
                    tracing::error!("emergency stop, because receiving requests failed: {error}");
                    self.state.emergency_stop();
                    break;
                }
            }
        }
    }

    fn carry_out(&mut self, control: &Control, now: Time) {
        let target = self.policy.find(control.target.as_str());
        match (control.kind(), target) {
            (Some(ControlKind::EmergencyStop), _) => self.state.emergency_stop(),
            (Some(ControlKind::Reset), _) => self.state.reset(),
            (Some(ControlKind::Enable), Some(index)) => self.state.enable(index),
            (Some(ControlKind::Disable), Some(index)) => self.state.disable(index),
            (Some(ControlKind::Goal), _) if is_goal(control.goal) => {
                let [x, y, theta, tolerance_m] = control.goal;
                let (stamp_ns, sequence) = (now.0, control.sequence);
                let goal = Goal { stamp_ns, sequence, x, y, theta, tolerance_m };
                if let Err(error) = self.goals.publish(&goal, &[]) {
                    tracing::error!("could not publish the goal: {error}");
                }
            }
            // Parameter updates have a server of their own.
            (Some(ControlKind::Retune), _) => {}
            _ => tracing::warn!("refused an invalid request: {control:?}"),
        }
    }

    /// Sets the clock that stamps the stages of commands; without it, time stands still within a step.
    pub fn keep_time_by(&mut self, time: TimeSource) {
        self.time = time;
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

    /// Brings the robot to a standstill for the end of the run.
    pub fn shut_down(&mut self) {
        self.state.shut_down();
    }
}

/// Returns true if x, y, theta (NaN for any heading) and tolerance make a goal.
fn is_goal([x, y, theta, tolerance_m]: [f64; 4]) -> bool {
    x.is_finite() && y.is_finite() && !theta.is_infinite() && tolerance_m.is_finite() && tolerance_m > 0.0
}
