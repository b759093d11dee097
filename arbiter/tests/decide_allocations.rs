//! A decision allocates nothing.

use std::time::Duration;

use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, Policy, TieRule, Wire};
use yamabico_core::message::{Axes, Proposal, Reason, Sector, Twist, Verdict};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::testing::{Allocations, allocations};
use yamabico_core::time::Time;

fn proposal(i: usize, tick: u64) -> Option<Proposal> {
    let ahead = Sector { center_rad: 0.1, half_width_rad: 1.0 };
    let proposal = match (i as u64 + tick) % 6 {
        0 => Proposal::halt(Axes::ANGULAR, Reason::Echo),
        1 => Proposal::limit(Axes::LINEAR, Twist::planar(0.3, 0.0), Reason::WallNear).in_sector(ahead),
        2 => Proposal::abstain(Reason::Clear),
        3 => return None,
        4 => Proposal::drive(Axes::PLANAR, Twist::planar(f64::NAN, 0.0)),
        _ => Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.1)),
    };
    let stamp = tick * 20_000_000;
    Some(Proposal { sequence: tick, stamp_ns: stamp, evidence_ns: stamp, ..proposal })
}

#[test]
fn a_decision_and_its_messages_allocate_nothing() {
    let behaviors = (0..64).map(|i| BehaviorPolicy {
        hold: Duration::from_millis(50),
        dwell: Duration::from_millis(30),
        ..BehaviorPolicy::new(&format!("b{i}"), i / 2)
    });
    let mut policy = Policy::new(
        MotionLimits::default(),
        Kinematics::Differential { base_m: 0.4, wheel_radius_m: 0.1, max_wheel_radps: 10.0 },
        behaviors.collect(),
    );
    policy.ties = TieRule::Blend;
    policy.wires = (0..32).map(|i| Wire::suppress(i, i + 32, Duration::from_millis(40))).collect();
    let mut state = ArbiterState::new(&policy);
    let mut decision = Decision::new(&policy);
    let mut proposals = vec![None; 64];
    let mut verdicts = vec![Verdict::default(); 64];

    let ((), counted) = allocations(|| {
        for tick in 1..500 {
            for (i, slot) in proposals.iter_mut().enumerate() {
                *slot = proposal(i, tick);
            }
            decide(&policy, &mut state, &proposals, Time(tick * 20_000_000), &mut decision);
            decision.command(&policy);
            decision.header(&policy);
            decision.write_verdicts(&policy, &mut verdicts);
        }
    });
    assert_eq!(counted, Allocations::default());
}
