//! What holds for every policy, every history and every proposal, sound or not.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;

use proptest::collection::vec;
use proptest::prelude::*;
use yamabico_arbiter::decide::{Decision, State, decide};
use yamabico_arbiter::kinematics::{Kinematics, OmniWheels};
use yamabico_arbiter::policy::{BehaviourPolicy, Contest, CriticalSensor, Policy, Wire};
use yamabico_core::message::{Axes, Axis, Kind, Mode, Proposal, Reason, Sector, Twist};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

const MOST: usize = 6;
const SLACK: f64 = 1e-9;
const LIMITS: MotionLimits = MotionLimits {
    speed: [0.8, 0.6, 1.5],
    acceleration: [3.0, 2.5, 8.0],
    deceleration: [4.0, 3.5, 10.0],
    emergency: [8.0, 6.0, 20.0],
    jerk: [200.0, 150.0, 600.0],
};

/// What one behaviour does before a decision.
#[derive(Clone, Debug)]
enum Act {
    Repeat,
    Keep,
    Clear,
    /// With ages of stamp and evidence, milliseconds.
    Say(Box<Proposal>, i64, i64),
    /// Bits as they come.
    Bits(Vec<u8>),
}

/// What happens before a decision.
#[derive(Clone, Debug)]
struct Moment {
    wait_ms: i64,
    acts: Vec<Act>,
    order: u8,
    sensor_works: bool,
}

/// A run: everything that `decide` is given.
#[derive(Clone)]
struct Run {
    policy: Policy,
    state: State,
    proposals: Vec<Option<Proposal>>,
    /// The first so many behaviours act.
    actors: usize,
    now: Time,
    sequence: u64,
    decision: Decision,
}

impl Run {
    fn new(policy: &Policy) -> Run {
        Run {
            policy: policy.clone(),
            state: State::new(policy),
            proposals: vec![None; policy.behaviours.len()],
            actors: policy.behaviours.len(),
            now: Time(100_000_000_000),
            sequence: 0,
            decision: Decision::new(policy),
        }
    }

    /// With one more behaviour at the end, which has no wires, is not critical and does nothing by itself.
    fn with_stranger(policy: &Policy) -> Run {
        let mut policy = policy.clone();
        policy.behaviours.push(BehaviourPolicy::new("stranger", 1000));
        Run { actors: policy.behaviours.len() - 1, ..Run::new(&policy) }
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
            Act::Say(proposal, age, evidence_age) => self.put(index, **proposal, *age, *evidence_age),
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
            .prop_map(|(centre_rad, half_width_rad)| Sector { centre_rad, half_width_rad }),
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
        6 => (proposal(), age_ms(), age_ms()).prop_map(|(p, age, older)| Act::Say(Box::new(p), age, older)),
        1 => spoilt().prop_map(|p| Act::Say(Box::new(p), 0, 0)),
        1 => vec(any::<u8>(), size_of::<Proposal>()).prop_map(Act::Bits),
    ]
}

/// A proposal with one number or code replaced by any bits.
fn spoilt() -> impl Strategy<Value = Proposal> {
    let number =
        prop_oneof![Just(f64::NAN), Just(f64::INFINITY), any::<f64>(), any::<u64>().prop_map(f64::from_bits)];
    (proposal(), 0..10_u8, number, any::<u32>()).prop_map(|(mut p, field, number, code)| {
        match field {
            0 => p.twist.linear = number,
            1 => p.twist.lateral = number,
            2 => p.twist.angular = number,
            3 => p.limits.linear = number,
            4 => p.limits.angular = number,
            5 => p.sector.centre_rad = number,
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
    (wait_ms, vec(act(), MOST), any::<u8>(), prop::bool::weighted(0.9))
        .prop_map(|(wait_ms, acts, order, sensor_works)| Moment { wait_ms, acts, order, sensor_works })
}

fn history() -> impl Strategy<Value = Vec<Moment>> {
    vec(moment(), 1..40)
}

fn kinematics() -> impl Strategy<Value = Kinematics> {
    let omni =
        |wheels| Kinematics::Omni { wheels, ring_radius_m: 0.2, wheel_radius_m: 0.05, max_wheel_rad_s: 14.0 };
    prop_oneof![
        Just(Kinematics::Body { axes: Axes::PLANAR }),
        Just(Kinematics::Body { axes: Axes::ALL }),
        Just(Kinematics::Differential { base_m: 0.4, wheel_radius_m: 0.1, max_wheel_rad_s: 6.0 }),
        Just(omni(OmniWheels::Three)),
        Just(omni(OmniWheels::Four)),
    ]
}

/// With wires that run from earlier to later behaviours only, so never in a circle.
fn policy() -> impl Strategy<Value = Policy> {
    let behaviour = (0..8_i32, prop::bool::weighted(0.15), 0..400_u64, 0..3_u64);
    let wire = (0..MOST, 0..MOST, any::<bool>(), 0..300_u64);
    (kinematics(), vec(behaviour, 1..=MOST), vec(wire, 0..4), any::<bool>(), prop::bool::weighted(0.2))
        .prop_map(|(kinematics, behaviours, wires, blend, guarded)| {
            let n = behaviours.len();
            let behaviours: Vec<BehaviourPolicy> = behaviours
                .into_iter()
                .enumerate()
                .map(|(i, (priority, critical, hold_ms, dwells))| BehaviourPolicy {
                    critical,
                    hold: Duration::from_millis(hold_ms),
                    dwell: Duration::from_millis(dwells / 2 * 100),
                    ..BehaviourPolicy::new(&format!("b{i}"), priority)
                })
                .collect();
            let mut policy = Policy::new(LIMITS, kinematics, behaviours);
            policy.contest = if blend { Contest::Blend } else { Contest::Strict };
            policy.wires = wires
                .into_iter()
                .filter(|&(by, what, ..)| by < what && what < n && !policy.behaviours[what].critical)
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

/// No axis is allowed more, and neither the translation nor the turn is faster.
fn assert_no_faster(slower: &Decision, faster: &Decision) -> Result<(), TestCaseError> {
    for axis in Axis::ALL {
        let (less, more) = (slower.allowed.get(axis).abs(), faster.allowed.get(axis).abs());
        prop_assert!(less <= more + SLACK, "{axis:?} allowed {less} instead of {more}");
    }
    let (less, more) = (slower.commanded, faster.commanded);
    prop_assert!(less.speed() <= more.speed() + SLACK, "{less:?} instead of {more:?}");
    prop_assert!(less.angular.abs() <= more.angular.abs() + SLACK, "{less:?} instead of {more:?}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_command_is_finite_and_within_the_limits(policy in policy(), history in history()) {
        let mut run = Run::new(&policy);
        let mut before = Twist::ZERO;
        for (i, moment) in history.iter().enumerate() {
            let twist = run.live(moment).commanded;
            prop_assert!(twist.is_finite());
            prop_assert_eq!(run.decision.sequence, i as u64 + 1);
            for axis in Axis::ALL {
                prop_assert!(twist.get(axis).abs() <= policy.speed(axis) + SLACK, "{:?}", twist);
            }
            let wheels = policy.kinematics.wheels_from_twist(twist).fastest();
            let most = match policy.kinematics {
                Kinematics::Differential { max_wheel_rad_s, .. } | Kinematics::Omni { max_wheel_rad_s, .. } => {
                    max_wheel_rad_s
                }
                Kinematics::Body { .. } => f64::INFINITY,
            };
            prop_assert!(wheels <= most + SLACK, "wheel at {} for {:?}", wheels, twist);
            let dt_s = (moment.wait_ms.max(20) as f64) * 1e-3;
            let change = (twist.angular - before.angular).abs();
            prop_assert!(change <= LIMITS.emergency[2] * dt_s + SLACK, "turn changes by {}", change);
            let faster = twist.speed() - before.speed();
            prop_assert!(faster <= LIMITS.acceleration[0] * dt_s.min(0.04) + SLACK, "faster by {}", faster);
            before = twist;
        }
    }

    #[test]
    fn a_halt_always_wins_on_the_axes_it_names(
        policy in policy(), history in history(), halt in halt(), spoil in 0..4_u8, bits in any::<u64>(),
    ) {
        let mut run = Run::with_stranger(&policy);
        for moment in &history {
            run.live(moment);
        }
        let named = if halt.axes.is_empty() { Axes::ALL } else { halt.axes };
        let halt = match spoil {
            0 => Proposal { confidence: f64::from_bits(bits), ..halt },
            1 => Proposal { twist: Twist::new(f64::from_bits(bits), 1.0, 1.0), ..halt },
            _ => halt,
        };
        run.wait(20);
        run.put(policy.behaviours.len(), halt, 0, if spoil == 2 { 5000 } else { 0 });
        let before = run.state.commanded();
        let after = run.decide().commanded;
        for axis in named.intersection(policy.axes()).iter() {
            prop_assert_eq!(run.decision.allowed.get(axis), 0.0);
            prop_assert!(run.decision.halted.contains(axis));
            prop_assert!(after.get(axis).abs() <= before.get(axis).abs());
            prop_assert!(!run.decision.rulings.iter().any(|ruling| ruling.won.contains(axis)));
        }
        // 0.8 m/s and 1.5 rad/s are gone in half a second.
        for _ in 0..26 {
            run.wait(20);
            run.put(policy.behaviours.len(), halt, 0, 0);
            run.decide();
        }
        for axis in named.intersection(policy.axes()).iter() {
            prop_assert_eq!(run.decision.commanded.get(axis), 0.0);
        }
    }

    #[test]
    fn one_more_limit_never_raises_a_speed(
        policy in policy(), history in history(), last in moment(), one_more in limit(), spoil in 0..6_u8,
    ) {
        let stranger = policy.behaviours.len();
        let mut run = Run::with_stranger(&policy);
        for moment in &history {
            run.live(moment);
        }
        run.prepare(&last);
        let mut limited = run.clone();
        limited.put(stranger, one_more, if spoil == 0 { 300 } else { 0 }, 0);
        if spoil == 1 {
            limited.proposals[stranger].as_mut().unwrap().limits.linear = f64::NAN;
        }
        assert_no_faster(limited.decide(), run.decide())?;
    }

    #[test]
    fn falling_silent_with_a_halt_or_limit_never_raises_a_speed_within_hold(
        policy in policy(), history in history(), last in vec(moment(), 1..12),
        who in 0..MOST, held in restraint(), clears in any::<bool>(),
    ) {
        let who = who % policy.behaviours.len();
        let mut run = Run::new(&policy);
        for moment in &history {
            run.live(moment);
        }
        run.state.enable(who);
        run.wait(20);
        run.put(who, held, 0, 0);
        run.decide();
        let said = run.now;
        for mut moment in last {
            moment.acts[who] = if clears { Act::Clear } else { Act::Keep };
            moment.wait_ms = moment.wait_ms.max(0);
            moment.order = u8::MAX;
            run.prepare(&moment);
            // The other author is never silent.
            let mut speaking = run.clone();
            speaking.put(who, held, 0, 0);
            let within_hold = run.now <= said + policy.behaviours[who].hold;
            run.decide();
            speaking.decide();
            if within_hold || policy.behaviours[who].critical {
                assert_no_faster(&run.decision, &speaking.decision)?;
            }
        }
    }

    #[test]
    fn the_order_of_behaviours_does_not_matter(
        policy in policy(), history in history(), places in Just((0..MOST).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        let n = policy.behaviours.len();
        let places: Vec<usize> = places.into_iter().filter(|&place| place < n).collect();
        let mut other = policy.clone();
        for (i, &place) in places.iter().enumerate() {
            other.behaviours[place] = policy.behaviours[i].clone();
        }
        for wire in &mut other.wires {
            (wire.by, wire.what) = (places[wire.by], places[wire.what]);
        }
        let (mut a, mut b) = (Run::new(&policy), Run::new(&other));
        for moment in &history {
            let mut moment = Moment { order: moment.order.min(4), ..moment.clone() };
            a.prepare(&moment);
            moment.acts.clear();
            b.prepare(&moment);
            for (i, &place) in places.iter().enumerate() {
                b.proposals[place] = a.proposals[i];
            }
            let (a, b) = (a.decide().clone(), b.decide());
            prop_assert_eq!(a.commanded, b.commanded);
            prop_assert_eq!((a.mode, a.halted, a.wanted), (b.mode, b.halted, b.wanted));
            for (i, &place) in places.iter().enumerate() {
                prop_assert_eq!(a.rulings[i].outcome, b.rulings[place].outcome);
                prop_assert_eq!(a.rulings[i].won, b.rulings[place].won);
            }
        }
    }

    #[test]
    fn the_stale_never_win(policy in policy(), history in history()) {
        let mut run = Run::new(&policy);
        let mut latest = Time::ZERO;
        for moment in &history {
            run.live(moment);
            latest = latest.max(run.now);
            for (i, behaviour) in policy.behaviours.iter().enumerate() {
                let sound = run.proposals[i].is_some_and(|p| {
                    p.kind() == Some(Kind::Drive)
                        && latest.since(Time(p.stamp_ns)) <= behaviour.max_age
                        && latest.since(Time(p.evidence_ns)) <= behaviour.max_evidence_age
                        && Time(p.stamp_ns.max(p.evidence_ns)) <= latest + policy.future_tolerance
                        && p.twist.is_finite()
                });
                if !sound {
                    prop_assert!(run.decision.rulings[i].won.is_empty());
                    prop_assert!(!run.decision.source.contains(&Some(i as u16)));
                }
            }
        }
    }

    #[test]
    fn when_time_runs_backwards_nothing_gets_faster(
        policy in policy(), history in history(), back_ms in 1..100_000_i64, last in moment(),
    ) {
        let mut run = Run::new(&policy);
        for moment in &history {
            run.live(&Moment { wait_ms: moment.wait_ms.abs(), ..moment.clone() });
        }
        let before = run.state.commanded();
        run.live(&Moment { wait_ms: -back_ms, ..last });
        let after = run.decision.commanded;
        prop_assert!(after.speed() <= before.speed() && after.angular.abs() <= before.angular.abs());
        prop_assert_eq!(run.decision.allowed, Twist::ZERO);
    }

    #[test]
    fn the_emergency_stop_is_latched_until_reset(policy in policy(), history in history(), rest in history()) {
        let mut run = Run::new(&policy);
        for moment in &history {
            run.live(moment);
        }
        run.state.emergency_stop();
        let mut before = run.state.commanded();
        for moment in &rest {
            run.live(&Moment { order: u8::MAX, ..moment.clone() });
            prop_assert_eq!(run.decision.mode, Mode::EmergencyStop);
            let after = run.decision.commanded;
            prop_assert!(after.speed() <= before.speed() && after.angular.abs() <= before.angular.abs());
            before = after;
        }
    }
}
