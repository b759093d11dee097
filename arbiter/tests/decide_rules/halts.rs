//! Halts and their duration.

use super::*;

/// Brings the robot to 0.5 m/s and 0.5 rad/s, driven by "low".
fn cruising(bench: &mut Bench) {
    bench.propose(1, Proposal::drive(Axes::PLANAR, Twist::planar(0.5, 0.5))).decide();
    bench.repeat_for(ms(2000));
    assert_eq!(bench.decision.commanded, Twist::planar(0.5, 0.5));
}

#[test]
fn a_halt_of_the_lowest_priority_stops_the_highest_with_the_emergency_deceleration() {
    let mut bench = Bench::differential(two());
    bench.propose(0, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.after(TICK).propose(1, halt());
    let decision = bench.decide().clone();
    assert!((decision.commanded.linear - (0.5 - 2.0 * 0.02)).abs() < 1e-9);
    assert_eq!((decision.mode, decision.halted, decision.emergency), (Mode::Halted, Axes::PLANAR, true));
    assert_eq!((bench.outcome(0), bench.outcome(1)), (Outcome::Stopped, Outcome::Halting));
    assert_eq!(bench.decision.rulings[0].by, Some(1));
    assert_eq!(bench.repeat_for(ms(300)).commanded, Twist::ZERO);
}

#[test]
fn a_halt_on_one_axis_leaves_the_others() {
    let mut bench = Bench::differential(two());
    cruising(&mut bench);
    let uncoupled = Proposal::drive(Axes::PLANAR, Twist::planar(0.5, 0.5)).uncoupled();
    bench.propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo)).propose(1, uncoupled);
    let decision = bench.repeat_for(ms(500));
    assert_eq!(decision.commanded, Twist::planar(0.0, 0.5));
    assert_eq!((bench.outcome(1), bench.decision.rulings[1].won), (Outcome::Won, Axes::ANGULAR));
}

#[test]
fn a_coupled_drive_that_a_halt_stops_on_one_axis_gives_up_all() {
    let mut bench = Bench::differential(two());
    cruising(&mut bench);
    bench.propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo));
    let decision = bench.repeat_for(ms(500));
    assert_eq!((decision.commanded, decision.source), (Twist::ZERO, [None; 3]));
    let ruling = bench.decision.rulings[1];
    assert_eq!((ruling.outcome, ruling.by, ruling.won), (Outcome::GaveUp, Some(0), Axes::NONE));
    let message = bench.decision.header(&bench.policy);
    assert_eq!(
        (message.wanted, message.wished),
        (Twist::ZERO, Twist::planar(0.5, 0.5)),
        "its wish stays known"
    );
    let text = bench.why();
    assert!(
        text.contains("low (10)    gives up linear+angular, because one axis is halted by high (100)"),
        "{text}"
    );
}

#[test]
fn axes_that_a_coupled_drive_gives_up_to_a_halt_are_free_for_the_next() {
    let mut behaviors = two();
    behaviors.push(BehaviorPolicy::new("lowest", 1));
    let mut bench = Bench::differential(behaviors);
    bench.propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo));
    bench.propose(1, Proposal::drive(Axes::PLANAR, Twist::planar(0.5, 0.5))).propose(2, turn(-0.3));
    let decision = bench.repeat_for(ms(500));
    assert_eq!((decision.commanded, decision.source[2]), (Twist::planar(0.0, -0.3), Some(2)));
}

#[test]
fn a_coupled_turn_on_the_spot_loses_nothing_to_a_halt_of_driving_forward() {
    let mut bench = Bench::differential(two());
    bench.propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo));
    bench.propose(1, Proposal::drive(Axes::PLANAR, Twist::planar(0.0, 0.4)));
    assert_eq!(bench.repeat_for(ms(500)).commanded, Twist::planar(0.0, 0.4));
    assert_eq!((bench.outcome(1), bench.decision.rulings[1].won), (Outcome::Won, Axes::ANGULAR));
}

#[test]
fn a_held_halt_is_recorded_as_a_halt_of_its_author() {
    let mut bench = Bench::differential(two());
    bench.propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo)).propose(1, forward(0.5)).decide();
    bench.after(ms(100)).propose(0, Proposal::abstain(Reason::Clear)).decide();
    let mut verdicts = [Verdict::default(); 2];
    bench.decision.write_verdicts(&bench.policy, &mut verdicts);
    let held = &verdicts[0];
    assert_eq!((held.outcome(), held.kind), (Some(Outcome::Held), Kind::Halt.code()));
    assert_eq!(held.claimed, Axes::LINEAR);
}

#[test]
fn the_authors_next_proposal_releases_it_but_not_before_hold_is_over() {
    let mut bench = Bench::differential(two());
    bench.propose(0, halt()).propose(1, forward(0.5)).decide();
    bench.after(ms(100)).propose(0, Proposal::abstain(Reason::Clear)).decide();
    assert_eq!((bench.decision.mode, bench.outcome(0)), (Mode::Halted, Outcome::Held));
    bench.after(ms(400)).propose(1, forward(0.5)).decide();
    assert_eq!(bench.decision.mode, Mode::Halted);
    bench.after(Duration::from_nanos(1)).decide();
    assert_eq!((bench.decision.mode, bench.outcome(0)), (Mode::Driving, Outcome::Stale));
}

#[test]
fn silence_is_no_release_until_hold_is_over() {
    for slot_is_cleared in [true, false] {
        let mut bench = Bench::differential(two());
        bench.propose(0, halt()).decide();
        if slot_is_cleared {
            bench.proposals[0] = None;
        }
        bench.after(ms(699)).propose(1, forward(0.5)).decide();
        assert_eq!((bench.decision.mode, bench.outcome(0)), (Mode::Halted, Outcome::Held));
        bench.after(ms(2)).propose(1, forward(0.5)).decide();
        assert_eq!(bench.decision.mode, Mode::Driving);
    }
}

#[test]
fn the_halt_of_a_dead_critical_author_stays_until_it_proposes_again() {
    let mut bench = two_with(|policy| {
        policy.behaviors[0].critical = true;
        policy.behaviors[0].deadline = Duration::from_secs(3600);
    });
    bench.propose(0, halt()).decide();
    bench.proposals[0] = None;
    bench.after(Duration::from_secs(600)).propose(1, forward(0.5)).decide();
    assert_eq!(bench.decision.mode, Mode::Halted);
    bench.propose(0, Proposal::abstain(Reason::Clear)).decide();
    assert_eq!(bench.decision.mode, Mode::Driving);
}

#[test]
fn the_halt_of_a_disabled_critical_author_stays_and_the_ruling_says_both() {
    let mut bench = two_with(|policy| {
        policy.behaviors[0].critical = true;
        policy.behaviors[0].deadline = Duration::from_secs(3600);
    });
    bench.propose(0, halt()).decide();
    bench.state.disable(0);
    bench.after(Duration::from_secs(1)).propose(1, forward(0.5)).decide();
    let ruling = &bench.decision.rulings[0];
    assert_eq!((bench.decision.mode, ruling.outcome), (Mode::Halted, Outcome::Held));
    assert_eq!(ruling.fault, Some(Outcome::Disabled));
    bench.state.enable(0);
    bench.propose(0, Proposal::abstain(Reason::Clear)).decide();
    assert_eq!((bench.decision.mode, bench.decision.rulings[0].fault), (Mode::Driving, None));
}

#[test]
fn a_stale_or_malformed_halt_is_still_a_halt() {
    for spoil in [
        |p: Proposal, now: u64| Proposal { stamp_ns: now - 5_000_000_000, ..p },
        |p: Proposal, now: u64| Proposal { evidence_ns: now - 5_000_000_000, ..p },
        |p: Proposal, now: u64| Proposal { stamp_ns: now + 5_000_000_000, ..p },
        |p: Proposal, _: u64| Proposal { axes: bytemuck::cast(0xffff_u32), ..p },
        |p: Proposal, _: u64| Proposal { stamp_ns: u64::MAX, twist: Twist::planar(f64::NAN, 0.0), ..p },
    ] {
        let mut bench = Bench::differential(two());
        let proposal = spoil(halt(), bench.now.0);
        bench.propose(0, proposal).propose(1, forward(0.5)).decide();
        assert_eq!((bench.decision.mode, bench.decision.halted), (Mode::Halted, Axes::PLANAR));
    }
}

#[test]
fn a_stale_proposal_releases_nothing() {
    let mut bench = Bench::differential(two());
    bench.propose(0, halt()).decide();
    bench.after(ms(600));
    let stamp_ns = bench.now.0 - 300_000_000;
    bench
        .propose(0, Proposal { stamp_ns, ..Proposal::abstain(Reason::Clear) })
        .propose(1, forward(0.5))
        .decide();
    assert_eq!((bench.decision.mode, bench.outcome(0)), (Mode::Halted, Outcome::Held));
}

#[test]
fn a_sound_halt_of_other_axes_replaces_the_first() {
    let mut bench = two_with(|policy| policy.behaviors[0].hold = ms(0));
    bench.propose(0, halt()).propose(1, forward(0.5)).decide();
    bench.after(TICK).propose(0, Proposal::halt(Axes::LINEAR, Reason::Echo)).decide();
    assert_eq!(bench.decision.halted, Axes::LINEAR);
}
