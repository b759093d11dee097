//! Properties that hold for every policy, every history and every proposal, valid or not.

mod commands;
mod restraints;

use std::time::Duration;

use proptest::collection::vec;
use proptest::prelude::*;
use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
use yamabico_arbiter::kinematics::{Kinematics, OmniWheels};
use yamabico_arbiter::policy::{BehaviorPolicy, CriticalSensor, Policy, TieRule, Wire};
use yamabico_core::message::{Axes, Axis, Kind, Mode, Proposal, Reason, Sector, Twist};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

const MAX_BEHAVIORS: usize = 6;
const SLACK: f64 = 1e-9;
const LIMITS: MotionLimits = MotionLimits {
    speed: [0.8, 0.6, 1.5],
    acceleration: [3.0, 2.5, 8.0],
    deceleration: [4.0, 3.5, 10.0],
    emergency: [8.0, 6.0, 20.0],
    jerk: [200.0, 150.0, 600.0],
};

/// Action of one behavior before a decision.
#[derive(Clone, Debug)]
enum Act {
    Repeat,
    Keep,
    Clear,
    /// With ages of stamp and evidence, ms.
    Propose(Box<Proposal>, i64, i64),
    /// Arbitrary bits.
    Bits(Vec<u8>),
}

/// Events before a decision.
#[derive(Clone, Debug)]
struct Moment {
    wait_ms: i64,
    acts: Vec<Act>,
    order: u8,
    sensor_works: bool,
}

/// A run: every argument of `decide`.
#[derive(Clone)]
struct Run {
    policy: Policy,
    state: ArbiterState,
    proposals: Vec<Option<Proposal>>,
    /// Number of behaviors that act, from the first.
    actors: usize,
    now: Time,
    sequence: u64,
    decision: Decision,
}

impl Run {
    fn new(policy: &Policy) -> Run {
        Run {
            policy: policy.clone(),
            state: ArbiterState::new(policy),
            proposals: vec![None; policy.behaviors.len()],
            actors: policy.behaviors.len(),
            now: Time(100_000_000_000),
            sequence: 0,
            decision: Decision::new(policy),
        }
    }

    /// A run with one more behavior at the end, which has no wires, is not critical and does not act.
    fn with_stranger(policy: &Policy, priority: i32) -> Run {
        let mut policy = policy.clone();
        policy.behaviors.push(BehaviorPolicy::new("stranger", priority));
        Run { actors: policy.behaviors.len() - 1, ..Run::new(&policy) }
    }

    fn put(&mut self, index: usize, proposal: Proposal, age_ms: i64, evidence_age_ms: i64) {
        self.sequence += 1;
        let ago = |ms: i64| self.now.0.saturating_add_signed(-ms * 1_000_000);
        self.proposals[index] = Some(Proposal {
            sequence: self.sequence,
            stamp_ns: ago(age_ms),
            evidence_ns: ago(evidence_age_ms),
            ..proposal
        });
    }

    fn act(&mut self, index: usize, act: &Act) {
        match act {
            Act::Keep => {}
            Act::Clear => self.proposals[index] = None,
            Act::Repeat => {
                if let Some(proposal) = self.proposals[index] {
                    self.put(index, proposal, 0, 0);
                }
            }
            Act::Propose(proposal, age, evidence_age) => self.put(index, **proposal, *age, *evidence_age),
            Act::Bits(bits) => self.proposals[index] = Some(bytemuck::pod_read_unaligned(bits)),
        }
    }

    fn wait(&mut self, ms: i64) {
        self.now = Time(self.now.0.saturating_add_signed(ms * 1_000_000));
    }

    fn decide(&mut self) -> &Decision {
        decide(&self.policy, &mut self.state, &self.proposals, self.now, &mut self.decision);
        &self.decision
    }

    fn live(&mut self, moment: &Moment) -> &Decision {
        self.prepare(moment);
        self.decide()
    }

    fn prepare(&mut self, moment: &Moment) {
        self.wait(moment.wait_ms);
        if moment.sensor_works {
            self.state.sensor_measured(0, self.now);
        }
        match moment.order {
            0 => self.state.emergency_stop(),
            1..=4 => self.state.reset(),
            5 => self.state.disable(0),
            6..=9 => self.state.enable(0),
            _ => {}
        }
        for (index, act) in moment.acts.iter().take(self.actors).enumerate() {
            self.act(index, act);
        }
    }
}

fn axes() -> impl Strategy<Value = Axes> {
    (0_u32..8).prop_map(|bits| Axes::from_bits(bits).unwrap())
}

fn twist() -> impl Strategy<Value = Twist> {
    // Whole tenths, so that speeds and directions coincide now and then.
    let speed = || prop_oneof![3 => (-16_i32..=16).prop_map(|n| f64::from(n) / 10.0), 1 => -1.6..1.6_f64];
    (speed(), speed(), speed()).prop_map(|(x, y, turn)| Twist::new(x, y, turn))
}

fn drive() -> impl Strategy<Value = Proposal> {
    (axes(), twist(), 0.0..=1.0_f64, any::<bool>()).prop_map(|(axes, twist, confidence, coupled)| {
        let proposal = Proposal::drive(axes, twist).with_confidence(confidence);
        if coupled { proposal } else { proposal.uncoupled() }
    })
}

fn limit() -> impl Strategy<Value = Proposal> {
    let sector = prop_oneof![
        Just(Sector::ALL),
        (-7.0..7.0_f64, 0.0..3.2_f64)
            .prop_map(|(center_rad, half_width_rad)| Sector { center_rad, half_width_rad }),
    ];
    (1_u32..8, twist(), sector).prop_map(|(bits, limits, sector)| {
        let limits = Twist::new(limits.linear.abs(), limits.lateral.abs(), limits.angular.abs());
        Proposal::limit(Axes::from_bits(bits).unwrap(), limits, Reason::WallNear).in_sector(sector)
    })
}

fn halt() -> impl Strategy<Value = Proposal> {
    axes().prop_map(|axes| Proposal::halt(axes, Reason::Echo))
}

fn restraint() -> impl Strategy<Value = Proposal> {
    prop_oneof![halt(), limit()]
}

fn proposal() -> impl Strategy<Value = Proposal> {
    prop_oneof![6 => drive(), 1 => halt(), 2 => limit(), 1 => Just(Proposal::abstain(Reason::Clear))]
}

fn age_ms() -> impl Strategy<Value = i64> {
    prop_oneof![8 => Just(0_i64), 2 => 0..250_i64, 1 => -50..2000_i64]
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        8 => Just(Act::Repeat),
        2 => Just(Act::Keep),
        1 => Just(Act::Clear),
        6 => (proposal(), age_ms(), age_ms()).prop_map(|(p, age, older)| Act::Propose(Box::new(p), age, older)),
        1 => corrupted().prop_map(|p| Act::Propose(Box::new(p), 0, 0)),
        1 => vec(any::<u8>(), size_of::<Proposal>()).prop_map(Act::Bits),
    ]
}

/// Priority below, among and above the others, which are 0 to 7.
fn priority() -> impl Strategy<Value = i32> {
    -2..10_i32
}

/// Age that is sometimes valid, else stale or in the future by any amount.
fn wild_age_ms() -> impl Strategy<Value = i64> {
    prop_oneof![2 => Just(0_i64), 1 => 0..10_000_i64, 1 => -10_000..0_i64, 1 => -1_000_000_000..1_000_000_000_i64]
}

/// A proposal with one number or code replaced by arbitrary bits.
fn corrupted() -> impl Strategy<Value = Proposal> {
    let number =
        prop_oneof![Just(f64::NAN), Just(f64::INFINITY), any::<f64>(), any::<u64>().prop_map(f64::from_bits)];
    (proposal(), 0..10_u8, number, any::<u32>()).prop_map(|(mut p, field, number, code)| {
        match field {
            0 => p.twist.linear = number,
            1 => p.twist.lateral = number,
            2 => p.twist.angular = number,
            3 => p.limits.linear = number,
            4 => p.limits.angular = number,
            5 => p.sector.center_rad = number,
            6 => p.sector.half_width_rad = number,
            7 => p.confidence = number,
            8 => p.kind = code,
            _ => p.axes = bytemuck::cast(code),
        }
        p
    })
}

fn moment() -> impl Strategy<Value = Moment> {
    let wait_ms = prop_oneof![12 => Just(20_i64), 4 => 0..60_i64, 2 => 0..900_i64, 1 => -300..0_i64];
    (wait_ms, vec(act(), MAX_BEHAVIORS), any::<u8>(), prop::bool::weighted(0.9))
        .prop_map(|(wait_ms, acts, order, sensor_works)| Moment { wait_ms, acts, order, sensor_works })
}

fn history() -> impl Strategy<Value = Vec<Moment>> {
    vec(moment(), 1..40)
}

fn kinematics() -> impl Strategy<Value = Kinematics> {
    let omni =
        |wheels| Kinematics::Omni { wheels, ring_radius_m: 0.2, wheel_radius_m: 0.05, max_wheel_radps: 14.0 };
    prop_oneof![
        Just(Kinematics::Body { axes: Axes::PLANAR }),
        Just(Kinematics::Body { axes: Axes::ALL }),
        Just(Kinematics::Differential { base_m: 0.4, wheel_radius_m: 0.1, max_wheel_radps: 6.0 }),
        Just(omni(OmniWheels::Three)),
        Just(omni(OmniWheels::Four)),
    ]
}

/// Policy whose wires run from earlier to later behaviors only, so that they form no cycle.
fn policy() -> impl Strategy<Value = Policy> {
    let behavior = (0..8_i32, prop::bool::weighted(0.15), 0..400_u64, 0..3_u64);
    let wire = (0..MAX_BEHAVIORS, 0..MAX_BEHAVIORS, any::<bool>(), 0..300_u64);
    (
        kinematics(),
        vec(behavior, 1..=MAX_BEHAVIORS),
        vec(wire, 0..4),
        any::<bool>(),
        prop::bool::weighted(0.2),
    )
        .prop_map(|(kinematics, behaviors, wires, blend, guarded)| {
            let n = behaviors.len();
            let behaviors: Vec<BehaviorPolicy> = behaviors
                .into_iter()
                .enumerate()
                .map(|(i, (priority, critical, hold_ms, dwells))| BehaviorPolicy {
                    critical,
                    hold: Duration::from_millis(hold_ms),
                    dwell: Duration::from_millis(dwells / 2 * 100),
                    ..BehaviorPolicy::new(&format!("b{i}"), priority)
                })
                .collect();
            let mut policy = Policy::new(LIMITS, kinematics, behaviors);
            policy.ties = if blend { TieRule::Blend } else { TieRule::Strict };
            policy.wires = wires
                .into_iter()
                .filter(|&(by, what, ..)| by < what && what < n && !policy.behaviors[what].critical)
                .map(|(by, what, inhibits, hold_ms)| {
                    let hold = Duration::from_millis(hold_ms);
                    if inhibits { Wire::inhibit(by, what, hold) } else { Wire::suppress(by, what, hold) }
                })
                .collect();
            if guarded {
                policy.sensors =
                    vec![CriticalSensor { name: "sonar".into(), max_age: Duration::from_millis(100) }];
            }
            policy
        })
}

/// Returns true if neither stamp nor evidence of `proposal` is too old or in the future.
fn is_live(proposal: &Proposal, behavior: &BehaviorPolicy, policy: &Policy, now: Time) -> bool {
    now.since(Time(proposal.stamp_ns)) <= behavior.max_age
        && now.since(Time(proposal.evidence_ns)) <= behavior.max_evidence_age
        && Time(proposal.stamp_ns.max(proposal.evidence_ns)) <= now + policy.future_tolerance
}
