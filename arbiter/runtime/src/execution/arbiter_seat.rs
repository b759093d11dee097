//! The arbiter at work: fed with proposals from the bus, its decisions and commands sent.

use std::collections::BTreeMap;

use yamabico_core::message::{
    Command, Control, ControlKind, DecisionHeader, Goal, MessageType, Proposal, Verdict,
};
use yamabico_core::time::{Time, TimeSource};
use yamabico_host::bus::{Bus, BusError, Publisher, RawSubscriber, Subscriber};

use super::plan::Plan;
use crate::report::{Latency, LatencyFigures};
use yamabico_arbiter::decide::{Decision, State, decide};
use yamabico_arbiter::policy::Policy;
use yamabico_host::topics;

/// The arbiter between proposals and commands. It alone holds the publisher of commands.
pub struct ArbiterSeat {
    policy: Policy,
    state: State,
    decision: Decision,
    proposals: Vec<Option<Proposal>>,
    /// When each proposal was taken in, and whether no command has followed it yet.
    heard: Vec<(Time, Novelty)>,
    latencies: Vec<Latency>,
    time: TimeSource,
    incoming: Vec<Subscriber<Proposal>>,
    sensors: Vec<(RawSubscriber, MessageType)>,
    controls: Subscriber<Control>,
    goals: Publisher<Goal>,
    commands: Publisher<Command>,
    decisions: Publisher<DecisionHeader>,
    verdicts: Vec<Verdict>,
    /// A decision could not be published.
    is_mute: bool,
}

/// Whether a command has followed a proposal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Novelty {
    New,
    Followed,
}

impl ArbiterSeat {
    /// Opens the arbiter's channels; commands first, so that nobody else can.
    ///
    /// # Errors
    /// Channels that do not open.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ArbiterSeat, BusError> {
        let policy = plan.policy.clone();
        let commands = bus.publisher(topics::COMMAND)?;
        let incoming =
            policy.behaviors.iter().map(|behavior| bus.subscriber(&topics::proposal(behavior.name.as_str())));
        let sensors = policy.sensors.iter().filter_map(|sensor| {
            let name = topics::sensor(sensor.name.as_str());
            let message = plan.topics.iter().find(|topic| topic.name == name)?.message;
            Some(bus.subscriber_raw(&name, &message).map(|subscriber| (subscriber, message)))
        });
        Ok(ArbiterSeat {
            state: State::new(&policy),
            decision: Decision::new(&policy),
            proposals: vec![None; policy.behaviors.len()],
            heard: vec![(Time::ZERO, Novelty::Followed); policy.behaviors.len()],
            latencies: vec![Latency::default(); policy.behaviors.len()],
            time: TimeSource::Step,
            incoming: incoming.collect::<Result<_, _>>()?,
            sensors: sensors.collect::<Result<_, _>>()?,
            controls: bus.subscriber(topics::CONTROL)?,
            goals: bus.publisher(topics::GOAL)?,
            commands,
            decisions: bus.publisher(topics::DECISION)?,
            verdicts: vec![Verdict::default(); policy.behaviors.len()],
            is_mute: false,
            policy,
        })
    }

    /// Takes in what has arrived, decides, and publishes the command and the decision. A bus that fails to deliver proposals
    /// is silence, which stops the robot, and one that fails to deliver requests is an emergency stop. A decision that
    /// cannot be sent is told once; only a command that cannot be sent is an error.
    ///
    /// # Errors
    /// The command could not be sent.
    pub fn step(&mut self, now: Time) -> Result<(), BusError> {
        self.listen(now);
        // Nothing that was heard is newer.
        let now = self.time.now(now);
        decide(&self.policy, &mut self.state, &self.proposals, now, &mut self.decision);
        let command = self.command(now);
        self.commands.publish(&command, &[])?;
        self.count(Time(command.sent_ns));
        let count = self.decision.write_verdicts(&self.policy, &mut self.verdicts);
        let told = self.decisions.publish(&self.decision.header(&self.policy), &self.verdicts[..count]);
        if let Err(error) = told
            && !std::mem::replace(&mut self.is_mute, true)
        {
            tracing::error!("decisions are not published: {error}");
        }
        Ok(())
    }

    /// The command with the stages of the proposal whose data is the oldest.
    fn command(&self, now: Time) -> Command {
        let command = self.decision.command(&self.policy);
        let of = self.decision.evidence_of.map(usize::from);
        let staged = of.and_then(|of| Some((self.proposals.get(of)?.as_ref()?, self.heard.get(of)?.0)));
        let sent_ns = self.time.now(now).0;
        match staged {
            Some((proposal, heard)) => Command {
                received_ns: proposal.received_ns,
                proposed_ns: proposal.proposed_ns,
                heard_ns: heard.0,
                sent_ns,
                ..command
            },
            None => Command { sent_ns, ..command },
        }
    }

    /// Counts the stages of proposals that the command sent at `sent` is the first to follow, and commands that are late.
    fn count(&mut self, sent: Time) {
        let proposals = self.proposals.iter().zip(&mut self.heard).zip(&mut self.latencies);
        for ((proposal, (heard, novelty)), latency) in proposals {
            if std::mem::replace(novelty, Novelty::Followed) == Novelty::New
                && let Some(proposal) = proposal
            {
                latency.add(proposal, *heard, sent);
            }
        }
        if let Some(latency) =
            self.decision.late.and_then(|late| self.latencies.get_mut(usize::from(late.behavior)))
        {
            latency.add_late();
        }
    }

    fn listen(&mut self, step: Time) {
        for ((slot, heard), incoming) in self.proposals.iter_mut().zip(&mut self.heard).zip(&self.incoming) {
            if let Ok(Some(newest)) = incoming.newest() {
                *slot = Some(*newest.header());
                *heard = (self.time.now(step), Novelty::New);
            }
        }
        for (index, (sensor, message)) in self.sensors.iter().enumerate() {
            if let Ok(Some(newest)) = sensor.newest() {
                self.state.sensor_measured(index, (message.stamps)(newest.header()).0);
            }
        }
        if let Err(error) = self.goals.welcome() {
            tracing::error!("a newcomer is not told the goal: {error}");
        }
        loop {
            let control = self.controls.receive();
            match control.map(|control| control.map(|control| *control.header())) {
                Ok(Some(control)) => self.obey(&control, self.time.now(step)),
                Ok(None) => break,
                Err(error) => {
                    // It may have been an emergency stop.
                    tracing::error!("emergency stop, because requests are not heard: {error}");
                    self.state.emergency_stop();
                    break;
                }
            }
        }
    }

    fn obey(&mut self, control: &Control, now: Time) {
        let target = self.policy.find(control.target.as_str());
        match (control.kind(), target) {
            (Some(ControlKind::EmergencyStop), _) => self.state.emergency_stop(),
            (Some(ControlKind::Reset), _) => self.state.reset(),
            (Some(ControlKind::Enable), Some(index)) => self.state.enable(index),
            (Some(ControlKind::Disable), Some(index)) => self.state.disable(index),
            (Some(ControlKind::Goal), _) if is_goal(control.goal) => {
                let [x, y, theta, tolerance_m] = control.goal;
                let (stamp_ns, sequence) = (now.0, control.sequence);
                let told = self.goals.publish(&Goal { stamp_ns, sequence, x, y, theta, tolerance_m }, &[]);
                if let Err(error) = told {
                    tracing::error!("a goal is not handed on: {error}");
                }
            }
            // Not the arbiter's to do.
            (Some(ControlKind::Retune), _) => {}
            _ => tracing::warn!("refused a request: {control:?}"),
        }
    }

    /// Stamps the stages of commands by `time`; without it, they stand still within a step.
    pub fn keep_time_by(&mut self, time: TimeSource) {
        self.time = time;
    }

    /// How long the stages of each behavior's proposals took, by name.
    pub fn latencies(&self) -> BTreeMap<String, LatencyFigures> {
        let behaviors = self.policy.behaviors.iter().zip(&self.latencies);
        behaviors
            .map(|(behavior, latency)| {
                (behavior.name.as_str().to_owned(), latency.figures(behavior.latency_budget))
            })
            .collect()
    }

    /// The decision made last.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// What it decides by.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// Brings the robot to rest for the end of the run.
    pub fn shut_down(&mut self) {
        self.state.shut_down();
    }
}

/// Whether x, y, theta (which may be NaN: any heading will do) and tolerance are a place that can be gone to.
fn is_goal([x, y, theta, tolerance_m]: [f64; 4]) -> bool {
    x.is_finite() && y.is_finite() && !theta.is_infinite() && tolerance_m.is_finite() && tolerance_m > 0.0
}
