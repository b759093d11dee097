//! Properties of commands.

use super::*;

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
            let max = match policy.kinematics {
                Kinematics::Differential { max_wheel_radps, .. } | Kinematics::Omni { max_wheel_radps, .. } => {
                    max_wheel_radps
                }
                Kinematics::Body { .. } => f64::INFINITY,
            };
            prop_assert!(wheels <= max + SLACK, "wheel at {} for {:?}", wheels, twist);
            let dt_s = (moment.wait_ms.max(20) as f64) * 1e-3;
            let change = (twist.angular - before.angular).abs();
            prop_assert!(change <= LIMITS.emergency[2] * dt_s + SLACK, "turn changes by {}", change);
            let faster = twist.speed() - before.speed();
            prop_assert!(faster <= LIMITS.acceleration[0] * dt_s.min(0.04) + SLACK, "faster by {}", faster);
            before = twist;
        }
    }

    #[test]
    fn a_coupled_drive_gets_all_of_its_axes_or_none(policy in policy(), history in history()) {
        let mut run = Run::new(&policy);
        for moment in &history {
            run.live(moment);
            for (ruling, proposal) in run.decision.rulings.iter().zip(&run.proposals) {
                let Some(drive) = proposal.filter(|p| p.coupled != 0 && !ruling.won.is_empty()) else { continue };
                for axis in drive.axes.iter().filter(|&axis| drive.twist.get(axis) != 0.0) {
                    prop_assert!(ruling.won.contains(axis), "{:?} drives without {:?}", ruling, axis);
                }
            }
        }
    }

    #[test]
    fn the_order_of_behaviors_does_not_matter(
        policy in policy(), history in history(), places in Just((0..MAX_BEHAVIORS).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        let n = policy.behaviors.len();
        let places: Vec<usize> = places.into_iter().filter(|&place| place < n).collect();
        let mut other = policy.clone();
        for (i, &place) in places.iter().enumerate() {
            other.behaviors[place] = policy.behaviors[i].clone();
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
            for (i, behavior) in policy.behaviors.iter().enumerate() {
                let sound = run.proposals[i].is_some_and(|p| {
                    p.kind() == Some(Kind::Drive) && is_live(&p, behavior, &policy, latest) && p.twist.is_finite()
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
