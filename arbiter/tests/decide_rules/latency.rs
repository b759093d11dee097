//! Latency budgets.

use super::*;
use yamabico_arbiter::policy::LatencyPolicy;

/// Bench in which "low" has a latency budget of 100 ms.
fn late(lateness: LatencyPolicy) -> Bench {
    two_with(|policy| {
        policy.latency_policy = lateness;
        policy.behaviors[1].latency_budget = Some(ms(100));
    })
}

fn of_data(bench: &Bench, age: Duration) -> Proposal {
    forward(1.0).with_evidence(Time(bench.now.0 - age.as_nanos() as u64))
}

#[test]
fn late_data_slows_to_the_share_of_the_budget_in_its_age() {
    for (age, allowed) in [(50, 1.0), (100, 1.0), (200, 0.5), (400, 0.25)] {
        let mut bench = late(LatencyPolicy::Slow);
        let proposal = of_data(&bench, ms(age));
        bench.propose(1, proposal);
        let decision = bench.decide().clone();
        assert!((decision.allowed.linear - allowed).abs() < 1e-12, "{age} ms: {}", decision.allowed.linear);
        let late_data = decision.late.map(|late| (late.behavior, late.age, late.factor));
        assert_eq!(late_data, (age > 100).then_some((1, ms(age), allowed)));
        let text = decision.note(&bench.policy).to_string();
        let expected = format!("slowed: data of low is {age} ms old");
        assert_eq!(text, if age > 100 { expected } else { String::new() });
    }
}

#[test]
fn a_slow_drive_is_not_slowed() {
    let mut bench = late(LatencyPolicy::Slow);
    let proposal = Proposal { twist: Twist::planar(0.3, 0.2), ..of_data(&bench, ms(200)) };
    bench.propose(1, proposal);
    assert_eq!(bench.decide().allowed, Twist::planar(0.3, 0.2));
}

#[test]
fn late_data_is_only_counted_unless_it_slows() {
    let mut bench = late(LatencyPolicy::Count);
    let proposal = of_data(&bench, ms(200));
    bench.propose(1, proposal);
    let decision = bench.decide().clone();
    assert_eq!((decision.allowed.linear, decision.late.map(|late| late.age)), (1.0, Some(ms(200))));
    assert_eq!(decision.note(&bench.policy).as_str(), "");
}

#[test]
fn only_a_winner_is_late() {
    let mut bench = late(LatencyPolicy::Slow);
    let proposal = of_data(&bench, ms(200));
    bench.propose(1, proposal).propose(0, forward(0.9));
    let decision = bench.decide();
    assert_eq!((decision.allowed.linear, decision.late, decision.evidence_of), (0.9, None, Some(0)));
}
