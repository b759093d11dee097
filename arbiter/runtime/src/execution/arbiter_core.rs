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

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::bytes_of;
    use yamabico_arbiter::kinematics::Kinematics;
    use yamabico_arbiter::policy::{BehaviorPolicy, Wire};
    use yamabico_core::message::{Axes, Reason, Twist};
    use yamabico_core::sensor::MotionLimits;
    use yamabico_testkit::fuzz;

    /// Tags of what a script says: a proposal, a request, or the time until the next decision, ms.
    const PROPOSAL: u8 = 0;
    const CONTROL: u8 = 1;

    fn policy() -> Policy {
        let behaviors = vec![BehaviorPolicy::new("high", 30), BehaviorPolicy::new("low", 10)];
        let mut policy = Policy::new(MotionLimits::default(), Kinematics::new(Axes::ALL, None), behaviors);
        policy.wires.push(Wire::inhibit(0, 1, std::time::Duration::from_millis(100)));
        policy
    }

    fn said(tag: u8, who: u8, message: &[u8]) -> Vec<u8> {
        [&[tag, who], message].concat()
    }

    /// Makes an arbiter hear a script, and checks every command.
    fn hear(script: &[u8]) {
        let mut core = ArbiterCore::new(policy());
        let limits = MotionLimits::default();
        let (mut rest, mut now) = (script, Time(1_000_000_000));
        while let [tag, who, message @ ..] = rest {
            let size = match *tag {
                PROPOSAL => size_of::<Proposal>(),
                CONTROL => size_of::<Control>(),
                _ => 0,
            };
            let Some((message, behind)) = message.split_at_checked(size) else { break };
            rest = behind;
            match *tag {
                PROPOSAL => core.hear_proposal(usize::from(*who), bytemuck::pod_read_unaligned(message), now),
                CONTROL => drop(core.hear_control(&bytemuck::pod_read_unaligned(message), now)),
                _ => {
                    now = Time(now.0 + 1_000_000 * u64::from(*who).max(1));
                    core.hear_sensor(usize::from(*tag), now);
                    core.decide(now);
                    let twist = core.command(now).twist;
                    assert!(twist.is_finite() && twist.linear.abs() <= limits.speed[0] + 1e-9, "{twist:?}");
                    assert!(twist.angular.abs() <= limits.speed[2] + 1e-9, "{twist:?}");
                }
            }
        }
    }

    #[test]
    fn fuzz_proposals_and_controls() {
        let stamp = Time(1_000_000_000);
        let drive = Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.2)).with_evidence(stamp);
        let stamped = |proposal: Proposal| Proposal { stamp_ns: stamp.0, ..proposal };
        let proposals = [
            stamped(drive),
            stamped(Proposal::halt(Axes::LINEAR, Reason::Echo)),
            stamped(Proposal::limit(Axes::PLANAR, Twist::planar(0.1, 0.1), Reason::Echo)),
            stamped(Proposal::abstain(Reason::Clear)),
        ];
        let controls = [
            ControlKind::EmergencyStop,
            ControlKind::Reset,
            ControlKind::Enable,
            ControlKind::Disable,
            ControlKind::Goal,
        ];
        let control =
            |kind: ControlKind| Control { kind: kind.code(), target: "low".into(), ..Control::default() };
        let decide = |ms: u8| vec![9, ms];
        let scripts: Vec<Vec<u8>> = proposals
            .iter()
            .flat_map(|first| {
                proposals.map(|second| {
                    [
                        said(PROPOSAL, 0, bytes_of(first)),
                        decide(20),
                        said(PROPOSAL, 1, bytes_of(&second)),
                        decide(20),
                        decide(200),
                    ]
                    .concat()
                })
            })
            .chain(controls.map(|kind| {
                [
                    said(PROPOSAL, 1, bytes_of(&proposals[0])),
                    decide(20),
                    said(CONTROL, 0, bytes_of(&control(kind))),
                    decide(20),
                ]
                .concat()
            }))
            .collect();
        fuzz::run("proposals", &scripts, hear);
    }
}
