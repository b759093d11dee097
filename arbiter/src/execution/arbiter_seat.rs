//! The arbiter at work: fed with proposals from the bus, its decisions and commands sent.

use yamabico_core::bus::{Bus, BusError, Publisher, RawSubscriber, Subscriber};
use yamabico_core::message::{Command, Control, ControlKind, DecisionHeader, MessageType, Proposal, Verdict};
use yamabico_core::time::Time;

use super::plan::Plan;
use super::topics;
use crate::decide::{Decision, State, decide};
use crate::policy::Policy;

/// The arbiter between proposals and commands. It alone holds the publisher of commands.
pub struct ArbiterSeat {
    policy: Policy,
    state: State,
    decision: Decision,
    proposals: Vec<Option<Proposal>>,
    incoming: Vec<Subscriber<Proposal>>,
    sensors: Vec<(RawSubscriber, MessageType)>,
    controls: Subscriber<Control>,
    commands: Publisher<Command>,
    decisions: Publisher<DecisionHeader>,
    verdicts: Vec<Verdict>,
    /// A decision could not be published.
    is_mute: bool,
}

impl ArbiterSeat {
    /// Opens the arbiter's channels; commands first, so that nobody else can.
    ///
    /// # Errors
    /// Channels that do not open.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ArbiterSeat, BusError> {
        let policy = plan.policy.clone();
        let commands = bus.publisher(topics::COMMAND)?;
        let incoming = policy
            .behaviours
            .iter()
            .map(|behavior| bus.subscriber(&topics::proposal(behavior.name.as_str())));
        let sensors = policy.sensors.iter().filter_map(|sensor| {
            let name = topics::sensor(sensor.name.as_str());
            let message = plan.topics.iter().find(|topic| topic.name == name)?.message;
            Some(bus.subscriber_raw(&name, &message).map(|subscriber| (subscriber, message)))
        });
        Ok(ArbiterSeat {
            state: State::new(&policy),
            decision: Decision::new(&policy),
            proposals: vec![None; policy.behaviours.len()],
            incoming: incoming.collect::<Result<_, _>>()?,
            sensors: sensors.collect::<Result<_, _>>()?,
            controls: bus.subscriber(topics::CONTROL)?,
            commands,
            decisions: bus.publisher(topics::DECISION)?,
            verdicts: vec![Verdict::default(); policy.behaviours.len()],
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
        self.listen();
        decide(&self.policy, &mut self.state, &self.proposals, now, &mut self.decision);
        self.commands.publish(&self.decision.command(&self.policy), &[])?;
        let count = self.decision.write_verdicts(&self.policy, &mut self.verdicts);
        let told = self.decisions.publish(&self.decision.header(&self.policy), &self.verdicts[..count]);
        if let Err(error) = told
            && !std::mem::replace(&mut self.is_mute, true)
        {
            tracing::error!("decisions are not published: {error}");
        }
        Ok(())
    }

    fn listen(&mut self) {
        for (slot, incoming) in self.proposals.iter_mut().zip(&self.incoming) {
            if let Ok(Some(newest)) = incoming.newest() {
                *slot = Some(*newest.header());
            }
        }
        for (index, (sensor, message)) in self.sensors.iter().enumerate() {
            if let Ok(Some(newest)) = sensor.newest() {
                self.state.sensor_measured(index, (message.stamps)(newest.header()).0);
            }
        }
        loop {
            let control = self.controls.receive();
            match control.map(|control| control.map(|control| *control.header())) {
                Ok(Some(control)) => obey(&self.policy, &mut self.state, &control),
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

fn obey(policy: &Policy, state: &mut State, control: &Control) {
    let target = || policy.find(control.target.as_str());
    match (control.kind(), target()) {
        (Some(ControlKind::EmergencyStop), _) => state.emergency_stop(),
        (Some(ControlKind::Reset), _) => state.reset(),
        (Some(ControlKind::Enable), Some(index)) => state.enable(index),
        (Some(ControlKind::Disable), Some(index)) => state.disable(index),
        _ => tracing::warn!("refused a request: {control:?}"),
    }
}
