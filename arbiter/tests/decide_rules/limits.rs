//! Limits and their sectors.

use super::*;

#[test]
fn the_smallest_limit_counts_whatever_its_priority() {
    let mut bench = Bench::differential(two());
    bench.policy.behaviors.push(BehaviorPolicy::new("driver", 1000));
    let mut bench = Bench::differential(bench.policy.behaviors);
    bench.propose(2, forward(0.5)).propose(0, slow(0.3)).propose(1, slow(0.2));
    let decision = bench.decide();
    assert_eq!(decision.allowed, Twist::planar(0.2, 0.0));
    assert_eq!(decision.limited_by[0], Some((1, 0.2)));
    assert_eq!((bench.outcome(0), bench.outcome(1)), (Outcome::Limiting, Outcome::Limiting));
    assert_eq!(bench.repeat_for(ms(1000)).commanded.linear, 0.2);
}

#[test]
fn the_authors_next_proposal_ends_a_limit_at_once() {
    let mut bench = Bench::differential(two());
    bench.propose(0, slow(0.1)).propose(1, forward(0.5)).decide();
    bench.propose(0, slow(0.4));
    assert_eq!(bench.decide().allowed.linear, 0.4);
    bench.propose(0, Proposal::abstain(Reason::Clear));
    assert_eq!(bench.decide().allowed.linear, 0.5);
}

#[test]
fn a_stale_or_malformed_limit_is_zero_for_hold() {
    for spoil in [
        |p: Proposal, now: u64| Proposal { stamp_ns: now - 5_000_000_000, ..p },
        |p: Proposal, _: u64| Proposal { limits: Twist::planar(f64::NAN, 0.0), ..p },
        |p: Proposal, _: u64| Proposal { limits: Twist::planar(-0.1, 0.0), ..p },
        |p: Proposal, _: u64| Proposal { axes: Axes::NONE, ..p },
        |p: Proposal, _: u64| p.in_sector(Sector { center_rad: f64::NAN, half_width_rad: 0.1 }),
    ] {
        let mut bench = Bench::differential(two());
        let proposal = spoil(slow(0.3), bench.now.0);
        bench.propose(0, proposal).propose(1, forward(0.5));
        assert_eq!(bench.decide().allowed.linear, 0.0);
        bench.after(ms(500)).propose(1, forward(0.5));
        assert_eq!(bench.decide().allowed.linear, 0.0);
        bench.after(ms(1)).propose(1, forward(0.5));
        assert_eq!(bench.decide().allowed.linear, 0.5);
    }
}

#[test]
fn a_limit_whose_author_falls_silent_becomes_zero_for_hold() {
    let mut bench = Bench::differential(two());
    bench.propose(0, slow(0.3).in_sector(Sector { center_rad: 3.0, half_width_rad: 0.1 })).decide();
    bench.after(ms(200)).propose(1, forward(0.5));
    assert_eq!(bench.decide().allowed.linear, 0.5);
    assert_eq!(bench.outcome(0), Outcome::LimitElsewhere);
    bench.after(ms(1));
    assert_eq!(bench.decide().allowed.linear, 0.0);
    assert_eq!(bench.outcome(0), Outcome::Held);
    bench.after(ms(500)).propose(1, forward(0.5));
    assert_eq!(bench.decide().allowed.linear, 0.5);
}

#[test]
fn a_sector_counts_only_for_translation_into_it() {
    let ahead = Sector { center_rad: 0.0, half_width_rad: 0.6 };
    let mut bench = Bench::differential(two());
    bench.propose(0, slow(0.1).in_sector(ahead)).propose(1, forward(0.5));
    assert_eq!(bench.decide().allowed.linear, 0.1);
    let mut bench = Bench::differential(two());
    bench.propose(0, slow(0.1).in_sector(ahead)).propose(1, forward(-0.5));
    assert_eq!(bench.decide().allowed.linear, -0.5);
    assert_eq!(bench.outcome(0), Outcome::LimitElsewhere);
}

#[test]
fn a_sector_behind_wraps_around() {
    let behind = Sector { center_rad: -3.1, half_width_rad: 0.3 };
    let mut bench = Bench::differential(two());
    bench.propose(0, slow(0.1).in_sector(behind)).propose(1, forward(-0.5));
    assert_eq!(bench.decide().allowed.linear, -0.1);
}

#[test]
fn a_limited_holonomic_translation_keeps_its_direction() {
    let mut bench = Bench::holonomic(two());
    let aslant = Proposal::drive(Axes::ALL, Twist { linear: 0.4, lateral: 0.2, angular: 0.3 });
    bench.propose(0, slow(0.1)).propose(1, aslant);
    let allowed = bench.decide().allowed;
    assert!((allowed.linear - 0.1).abs() < 1e-12 && (allowed.lateral - 0.05).abs() < 1e-12, "{allowed:?}");
    assert_eq!(allowed.angular, 0.3);
}

#[test]
fn a_sector_that_the_velocity_swings_through_counts() {
    let mut bench = Bench::holonomic(two());
    let towards = |lateral: f64| Proposal::drive(Axes::ALL, Twist { linear: 0.5, lateral, angular: 0.0 });
    bench.propose(1, towards(0.5)).decide();
    bench.repeat_for(ms(3000));
    bench.after(TICK).propose(1, towards(-0.5));
    bench.propose(0, slow(0.1).in_sector(Sector { center_rad: 0.0, half_width_rad: 0.1 }));
    assert!(bench.decide().allowed.linear < 0.1 + 1e-9);
    assert_eq!(bench.outcome(0), Outcome::Limiting);
}
