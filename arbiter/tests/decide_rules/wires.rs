//! Inhibition, suppression and dwell.

use super::*;

#[test]
fn an_inhibited_drive_is_ignored_while_the_source_is_active_and_hold_after() {
    let mut bench = two_with(|policy| policy.wires = vec![Wire::inhibit(1, 0, ms(100))]);
    bench.propose(0, forward(0.3)).propose(1, turn(0.5)).decide();
    assert_eq!((bench.outcome(0), bench.decision.rulings[0].by), (Outcome::Inhibited, Some(1)));
    assert_eq!(bench.decision.source, [None, None, Some(1)]);
    bench.propose(1, Proposal::abstain(Reason::Clear)).after(ms(99)).decide();
    assert_eq!(bench.outcome(0), Outcome::Inhibited);
    bench.after(ms(1)).decide();
    assert_eq!(bench.outcome(0), Outcome::Won);
}

#[test]
fn a_halt_passes_an_inhibition_and_is_active_itself() {
    let mut bench = two_with(|policy| policy.wires = vec![Wire::inhibit(1, 0, ms(0))]);
    bench.propose(0, halt()).propose(1, forward(0.5));
    assert_eq!(bench.decide().mode, Mode::Halted);
    let mut bench = two_with(|policy| policy.wires = vec![Wire::inhibit(0, 1, ms(0))]);
    bench.propose(0, slow(0.5)).propose(1, forward(0.5)).decide();
    assert_eq!(bench.outcome(1), Outcome::Inhibited);
}

#[test]
fn suppression_takes_only_the_axes_that_the_other_claims_or_last_claimed() {
    let mut bench = two_with(|policy| policy.wires = vec![Wire::suppress(1, 0, ms(100))]);
    bench.propose(0, forward(0.3).uncoupled()).propose(1, turn(0.5)).decide();
    assert_eq!(bench.decision.source, [Some(0), None, Some(1)]);
    assert_eq!((bench.outcome(0), bench.decision.rulings[0].by), (Outcome::WonPart, Some(1)));
    bench.propose(1, Proposal::abstain(Reason::Clear)).after(ms(50)).decide();
    assert_eq!(bench.decision.source, [Some(0), None, None]);
    bench.propose(0, turn(0.1)).decide();
    assert_eq!(bench.outcome(0), Outcome::Suppressed);
    bench.propose(0, forward(0.3)).decide();
    assert_eq!(bench.outcome(0), Outcome::GaveUp);
}

#[test]
fn an_inhibited_behavior_does_not_inhibit_others() {
    let mut behaviors = two();
    behaviors.push(BehaviorPolicy::new("middle", 50));
    let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, behaviors);
    policy.wires = vec![Wire::inhibit(2, 1, ms(0)), Wire::inhibit(0, 2, ms(0))];
    let mut bench = Bench::new(policy);
    bench
        .propose(0, turn(0.5))
        .propose(2, forward(0.2))
        .propose(1, Proposal::drive(Axes::LINEAR, Twist::planar(0.4, 0.0)));
    bench.decide();
    assert_eq!((bench.outcome(2), bench.outcome(1)), (Outcome::Inhibited, Outcome::Won));
}

#[test]
fn a_hand_over_waits_towards_a_lower_priority_only() {
    let mut bench = two_with(|policy| policy.behaviors[0].dwell = ms(300));
    bench.propose(0, forward(0.3)).propose(1, forward(0.6)).decide();
    bench.propose(0, Proposal::abstain(Reason::TooFewSegments)).after(ms(150));
    bench.propose(1, forward(0.6)).decide();
    assert_eq!((bench.outcome(1), bench.decision.rulings[1].by), (Outcome::Waiting, Some(0)));
    assert_eq!(bench.decision.wanted, Twist::ZERO);
    bench.after(ms(150)).decide();
    assert_eq!(bench.outcome(1), Outcome::Won);
    bench.propose(0, forward(0.3)).decide();
    assert_eq!(bench.outcome(0), Outcome::Won);
}

#[test]
fn a_sleeping_behavior_is_ruled_inhibited_although_it_is_silent() {
    for (sleeps, silent, stale) in
        [(true, Outcome::Inhibited, Outcome::Inhibited), (false, Outcome::Silent, Outcome::Stale)]
    {
        let mut bench = two_with(|policy| {
            policy.wires = vec![Wire::inhibit(0, 1, ms(100))];
            policy.behaviors[1].sleeps = sleeps;
        });
        bench.propose(0, forward(0.2)).decide();
        assert_eq!(bench.outcome(1), silent);
        bench.propose(1, forward(0.5)).decide();
        assert_eq!(bench.outcome(1), Outcome::Inhibited);
        bench.after(ms(201)).propose(0, forward(0.2)).decide();
        assert_eq!(bench.outcome(1), stale, "it has not been called since");
        bench.propose(0, Proposal::abstain(Reason::Clear)).decide();
        assert_eq!(bench.outcome(1), stale, "the wire still holds");
        bench.after(ms(101)).decide();
        assert_eq!(bench.outcome(1), Outcome::Stale, "which wakes it");
    }
}
