//! Blending of equal priorities.

use super::*;

fn equals() -> Bench {
    let behaviors = ["a", "b", "c"].map(|name| BehaviorPolicy::new(name, 10)).to_vec();
    let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, behaviors);
    policy.ties = TieRule::Blend;
    Bench::new(policy)
}

#[test]
fn equal_priorities_are_averaged_by_confidence_on_each_axis() {
    let mut bench = equals();
    bench.propose(0, forward(0.2).with_confidence(0.25)).propose(1, forward(0.6).with_confidence(0.75));
    bench.propose(2, turn(0.4).with_confidence(1.0));
    let decision = bench.decide();
    assert!((decision.wanted.linear - 0.5).abs() < 1e-12);
    assert!((decision.wanted.angular - 0.2).abs() < 1e-12);
    assert_eq!(decision.source, [Some(1), None, Some(2)]);
    assert_eq!(bench.outcome(0), Outcome::Blended);
}

#[test]
fn without_confidence_the_mean_is_plain_and_a_single_proposal_wins() {
    let mut bench = equals();
    bench.propose(0, forward(0.2).with_confidence(0.0)).propose(1, forward(0.6).with_confidence(0.0));
    assert!((bench.decide().wanted.linear - 0.4).abs() < 1e-12);
    bench.proposals[0] = None;
    assert_eq!(bench.decide().wanted.linear, 0.6);
    assert_eq!(bench.outcome(1), Outcome::Won);
}

#[test]
fn with_the_strict_rule_the_name_that_sorts_first_wins() {
    let mut bench = equals();
    bench.policy.ties = TieRule::Strict;
    bench.state = ArbiterState::new(&bench.policy);
    bench.propose(1, forward(0.6)).propose(2, forward(0.2));
    assert_eq!(bench.decide().source[0], Some(1));
}
