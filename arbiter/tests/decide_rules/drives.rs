//! Drive proposals: which of them win, and which are ignored.

use super::*;

#[test]
fn the_highest_priority_drives_and_reaches_its_speed() {
    let mut bench = Bench::differential(two());
    bench.propose(0, forward(0.3)).propose(1, forward(0.6)).decide();
    let decision = bench.repeat_for(ms(2000));
    assert_eq!(decision.commanded, Twist::planar(0.3, 0.0));
    assert_eq!((decision.mode, decision.source), (Mode::Driving, [Some(0), None, Some(0)]));
    assert_eq!((bench.outcome(0), bench.outcome(1)), (Outcome::Won, Outcome::Outranked));
    assert_eq!(bench.decision.rulings[1].by, Some(0));
}

#[test]
fn each_axis_goes_to_the_highest_that_claims_it() {
    let mut bench = Bench::differential(two());
    bench.propose(0, turn(0.5)).propose(1, forward(0.4).uncoupled());
    let decision = bench.decide();
    assert_eq!(decision.wanted, Twist::planar(0.4, 0.5));
    assert_eq!(decision.source, [Some(1), None, Some(0)]);
    assert_eq!((bench.outcome(0), bench.outcome(1)), (Outcome::Won, Outcome::WonPart));
}

#[test]
fn a_coupled_drive_that_lost_one_axis_gives_up_all() {
    let mut bench = Bench::differential(two());
    bench.propose(0, turn(0.5)).propose(1, forward(0.4));
    assert_eq!(bench.decide().wanted, Twist::planar(0.0, 0.5));
    assert_eq!(bench.outcome(1), Outcome::GaveUp);
    assert_eq!(bench.decision.rulings[1].by, Some(0));
}

#[test]
fn axes_that_a_coupled_drive_gives_up_are_free_for_the_next() {
    let mut behaviors = two();
    behaviors.push(BehaviorPolicy::new("lowest", 1));
    let mut bench = Bench::differential(behaviors);
    let straight = Proposal::drive(Axes::LINEAR, Twist::planar(0.2, 0.0));
    bench.propose(0, turn(0.5)).propose(1, forward(0.4)).propose(2, straight);
    assert_eq!(bench.decide().wanted, Twist::planar(0.2, 0.5));
}

#[test]
fn an_unclaimed_axis_ramps_to_zero() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.proposals[1] = None;
    let decision = bench.after(TICK).decide().clone();
    assert_eq!((decision.mode, decision.emergency), (Mode::Idle, false));
    assert!((decision.commanded.linear - 0.48).abs() < 1e-9, "{:?}", decision.commanded);
    assert_eq!(bench.repeat_for(ms(1000)).commanded, Twist::ZERO);
}

#[test]
fn a_stale_drive_is_ignored() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.5)).after(ms(200)).decide();
    assert_eq!(bench.outcome(1), Outcome::Won);
    bench.after(ms(1)).decide();
    assert_eq!((bench.outcome(1), bench.decision.wanted), (Outcome::Stale, Twist::ZERO));
    assert!((bench.decision.rulings[1].number - 0.201).abs() < 1e-9);
}

#[test]
fn a_fresh_drive_on_stale_evidence_is_ignored() {
    let mut bench = Bench::differential(two());
    let old = bench.now - ms(1001);
    bench.propose(1, forward(0.5).with_evidence(old)).decide();
    assert_eq!((bench.outcome(1), bench.decision.wanted), (Outcome::StaleEvidence, Twist::ZERO));
}

#[test]
fn a_stamp_too_far_in_the_future_is_ignored() {
    let mut bench = Bench::differential(two());
    let stamp_ns = bench.now.0 + 2_000_000;
    bench.propose(1, Proposal { stamp_ns, ..forward(0.5) }).decide();
    assert_eq!(bench.outcome(1), Outcome::Won);
    bench.propose(1, Proposal { stamp_ns: stamp_ns + 1, ..forward(0.5) }).decide();
    assert_eq!((bench.outcome(1), bench.decision.wanted), (Outcome::FromTheFuture, Twist::ZERO));
}

#[test]
fn malformed_drives_are_ignored() {
    let wrong = [
        forward(f64::NAN),
        forward(f64::INFINITY),
        forward(2.001),
        turn(-4.001),
        forward(0.1).with_confidence(f64::NAN),
        forward(0.1).with_confidence(1.1),
        Proposal { kind: 99, ..forward(0.1) },
        Proposal { axes: Axes::NONE, ..forward(0.1) },
        Proposal { axes: bytemuck::cast(8_u32), ..forward(0.1) },
        Proposal { twist: Twist { lateral: f64::NAN, ..Twist::ZERO }, ..forward(0.1) },
    ];
    for proposal in wrong {
        let mut bench = Bench::differential(two());
        bench.propose(0, proposal).propose(1, forward(0.2)).decide();
        assert_eq!(bench.outcome(0), Outcome::Malformed, "{proposal:?}");
        assert_eq!(bench.decision.wanted.linear, 0.2);
    }
}

#[test]
fn a_drive_within_twice_the_limits_is_clamped() {
    let mut bench = Bench::differential(two());
    bench.propose(1, Proposal::drive(Axes::PLANAR, Twist::planar(2.0, -4.0)));
    assert_eq!(bench.decide().allowed, Twist::planar(1.0, -2.0));
    assert_eq!(bench.outcome(1), Outcome::Won);
}

#[test]
fn a_disabled_drive_is_ignored_until_enabled() {
    let mut bench = two_with(|policy| policy.behaviors[0].enabled = false);
    bench.propose(0, forward(0.3)).propose(1, forward(0.6)).decide();
    assert_eq!((bench.outcome(0), bench.decision.source[0]), (Outcome::Disabled, Some(1)));
    bench.state.enable(0);
    assert_eq!(bench.decide().source[0], Some(0));
    bench.state.disable(0);
    assert_eq!(bench.decide().source[0], Some(1));
}

#[test]
fn a_motion_along_an_axis_that_the_drive_lacks_is_given_up() {
    let mut bench = Bench::differential(two());
    bench.propose(0, Proposal::drive(Axes::ALL, Twist { linear: 0.3, lateral: 0.2, angular: 0.0 }));
    assert_eq!(bench.decide().wanted, Twist::ZERO);
    assert_eq!(bench.outcome(0), Outcome::GaveUp);
    bench.propose(0, Proposal::drive(Axes::LATERAL, Twist { lateral: 0.2, ..Twist::ZERO })).decide();
    assert_eq!((bench.outcome(0), bench.decision.rulings[0].by), (Outcome::Outranked, None));
    bench.propose(0, Proposal::drive(Axes::ALL, Twist::planar(0.3, 0.0))).decide();
    assert_eq!(bench.outcome(0), Outcome::Won);
}
