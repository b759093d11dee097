//! Policies that are refused.

use super::*;

fn policy(change: impl FnOnce(&mut Policy)) -> Vec<Mistake> {
    let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, two());
    change(&mut policy);
    policy.mistakes()
}

#[test]
fn a_sound_policy_has_none() {
    assert_eq!(policy(|_| ()), []);
    assert_eq!(policy(|p| p.wires = vec![Wire::inhibit(0, 1, TICK), Wire::suppress(0, 1, TICK)]), []);
}

#[test]
fn equal_priorities_need_a_blend() {
    let equal = |p: &mut Policy| p.behaviours[1].priority = 100;
    assert_eq!(policy(equal), [Mistake::EqualPriorities { first: 0, second: 1 }]);
    assert_eq!(
        policy(|p| {
            equal(p);
            p.contest = Contest::Blend;
        }),
        []
    );
}

#[test]
fn wires_in_a_circle_onto_a_critical_one_or_loose_are_refused() {
    let circle = vec![Wire::inhibit(0, 1, TICK), Wire::suppress(1, 0, TICK)];
    assert_eq!(policy(|p| p.wires = circle), [Mistake::WireCycle { wires: vec![0, 1] }]);
    assert_eq!(
        policy(|p| p.wires = vec![Wire::inhibit(0, 0, TICK)]),
        [Mistake::WireCycle { wires: vec![0] }]
    );
    assert_eq!(policy(|p| p.wires = vec![Wire::inhibit(0, 7, TICK)]), [Mistake::LooseWire { wire: 0 }]);
    let onto_critical = policy(|p| {
        p.behaviours[1].critical = true;
        p.wires = vec![Wire::inhibit(0, 1, TICK)];
    });
    assert_eq!(onto_critical, [Mistake::WireOntoCritical { wire: 0 }]);
}

#[test]
fn behaviours_that_can_never_win_are_named() {
    assert_eq!(
        policy(|p| p.behaviours[1].claims = Axes::LATERAL),
        [Mistake::ClaimsNothingHere { behaviour: 1, claims: Axes::LATERAL, has: Axes::PLANAR }]
    );
    assert_eq!(
        policy(|p| p.wires = vec![Wire::inhibit(1, 0, Duration::MAX)]),
        [Mistake::InhibitedForEver { behaviour: 0, wire: 0 }]
    );
    assert_eq!(
        policy(|p| p.behaviours[0].never_abstains = true),
        [Mistake::NeverReached { behaviour: 1, by: 0 }]
    );
}

#[test]
fn numbers_out_of_range_are_all_listed() {
    let mistakes = policy(|p| {
        p.rate_hz = f64::NAN;
        p.limits.acceleration[0] = 0.0;
        p.limits.emergency[2] = 1.0;
        p.limits.acceleration[1] = f64::NAN;
    });
    assert_eq!(mistakes.len(), 3, "{mistakes:?}");
}

#[test]
fn a_mistake_is_told_with_names() {
    let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, two());
    policy.wires = vec![Wire::inhibit(0, 1, TICK), Wire::suppress(1, 0, TICK)];
    let mistakes = policy.mistakes();
    assert_eq!(policy.describe(&mistakes[0]).to_string(), "wires lead in a circle: high -> low -> high");
}
