//! Rules of arbitration, one test for each.

mod blends;
mod drives;
mod explanations;
mod halts;
mod latency;
mod limits;
mod safety;
mod wires;

use std::time::Duration;

use yamabico_arbiter::decide::{ArbiterState, Decision, DecisionMessage, ExplainContext, decide, explain};
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, CriticalSensor, Policy, TieRule, Wire};
use yamabico_arbiter::safety::Stop;
use yamabico_core::message::{Axes, Kind, Mode, Outcome, Proposal, Reason, Sector, Twist, Verdict};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

const LIMITS: MotionLimits = MotionLimits {
    speed: [1.0, 1.0, 2.0],
    acceleration: [0.5, 0.5, 2.0],
    deceleration: [1.0, 1.0, 3.0],
    emergency: [2.0, 2.0, 6.0],
    jerk: [50.0, 50.0, 200.0],
};
const TICK: Duration = Duration::from_millis(20);

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// Arbiter whose proposals are set by hand, decided tick by tick.
struct Bench {
    policy: Policy,
    state: ArbiterState,
    proposals: Vec<Option<Proposal>>,
    now: Time,
    sequence: u64,
    decision: Decision,
}

impl Bench {
    fn new(policy: Policy) -> Bench {
        let state = ArbiterState::new(&policy);
        let decision = Decision::new(&policy);
        let proposals = vec![None; policy.behaviors.len()];
        Bench { policy, state, proposals, now: Time(10_000_000_000), sequence: 0, decision }
    }

    fn differential(behaviors: Vec<BehaviorPolicy>) -> Bench {
        Bench::new(Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, behaviors))
    }

    fn holonomic(behaviors: Vec<BehaviorPolicy>) -> Bench {
        Bench::new(Policy::new(LIMITS, Kinematics::Body { axes: Axes::ALL }, behaviors))
    }

    /// Sets the proposal of behavior `index`; missing stamps become the current time.
    fn propose(&mut self, index: usize, proposal: Proposal) -> &mut Bench {
        self.sequence += 1;
        let or_now = |stamp: u64| if stamp == 0 { self.now.0 } else { stamp };
        self.proposals[index] = Some(Proposal {
            sequence: self.sequence,
            stamp_ns: or_now(proposal.stamp_ns),
            evidence_ns: or_now(proposal.evidence_ns),
            ..proposal
        });
        self
    }

    fn decide(&mut self) -> &Decision {
        decide(&self.policy, &mut self.state, &self.proposals, self.now, &mut self.decision);
        &self.decision
    }

    fn after(&mut self, duration: Duration) -> &mut Bench {
        self.now = self.now + duration;
        self
    }

    /// Repeats every proposal, freshly stamped, for `duration`.
    fn repeat_for(&mut self, duration: Duration) -> &Decision {
        let end = self.now + duration;
        while self.now < end {
            self.now = self.now + TICK;
            for index in 0..self.proposals.len() {
                if let Some(proposal) = self.proposals[index] {
                    self.propose(index, Proposal { stamp_ns: 0, evidence_ns: 0, ..proposal });
                }
            }
            self.decide();
        }
        &self.decision
    }

    fn why(&self) -> String {
        let context = ExplainContext::of(&self.policy, &self.proposals);
        explain(&DecisionMessage::new(&self.policy, &self.decision), &context).to_string()
    }

    fn outcome(&self, index: usize) -> Outcome {
        self.decision.rulings[index].outcome
    }
}

fn forward(speed: f64) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::planar(speed, 0.0))
}

fn turn(rate: f64) -> Proposal {
    Proposal::drive(Axes::ANGULAR, Twist::planar(0.0, rate))
}

fn halt() -> Proposal {
    Proposal::halt(Axes::NONE, Reason::Echo)
}

fn slow(limit: f64) -> Proposal {
    Proposal::limit(Axes::LINEAR, Twist::planar(limit, 0.0), Reason::WallNear)
}

fn two() -> Vec<BehaviorPolicy> {
    vec![BehaviorPolicy::new("high", 100), BehaviorPolicy::new("low", 10)]
}

/// Bench of two behaviors: "high" at index 0, "low" at index 1.
fn two_with(change: impl FnOnce(&mut Policy)) -> Bench {
    let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, two());
    change(&mut policy);
    Bench::new(policy)
}
