//! Properties of halts and limits.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_halt_always_wins_on_the_axes_it_names(
        policy in policy(), history in history(), priority in priority(), halt in halt(),
        spoil in 0..5_u8, bits in any::<u64>(), ages_ms in (wild_age_ms(), wild_age_ms()),
    ) {
        let mut run = Run::with_stranger(&policy, priority);
        for moment in &history {
            run.live(moment);
        }
        let halt = match spoil {
            0 => Proposal { confidence: f64::from_bits(bits), ..halt },
            1 => Proposal { twist: Twist::new(f64::from_bits(bits), 1.0, 1.0), ..halt },
            2 => Proposal { axes: bytemuck::cast(bits as u32), ..halt },
            _ => halt,
        };
        let named = if halt.axes.is_valid() && !halt.axes.is_empty() { halt.axes } else { Axes::ALL };
        run.wait(20);
        run.put(policy.behaviors.len(), halt, ages_ms.0, ages_ms.1);
        let before = run.state.commanded();
        let after = run.decide().commanded;
        for axis in named.intersection(policy.axes()).iter() {
            prop_assert_eq!(run.decision.allowed.get(axis), 0.0);
            prop_assert!(run.decision.halted.contains(axis));
            prop_assert!(after.get(axis).abs() <= before.get(axis).abs());
            prop_assert!(!run.decision.rulings.iter().any(|ruling| ruling.won.contains(axis)));
        }
        // From 0.8 m/s and 1.5 rad/s, the robot stops within half a second.
        for _ in 0..26 {
            run.wait(20);
            run.put(policy.behaviors.len(), halt, ages_ms.0, ages_ms.1);
            run.decide();
        }
        for axis in named.intersection(policy.axes()).iter() {
            prop_assert_eq!(run.decision.commanded.get(axis), 0.0);
        }
    }

    #[test]
    fn one_more_limit_never_raises_a_speed(
        policy in policy(), history in history(), last in moment(), one_more in limit(), spoil in 0..6_u8,
        priority in priority(),
    ) {
        let stranger = policy.behaviors.len();
        let mut run = Run::with_stranger(&policy, priority);
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

    // Once two runs have diverged, the slower one may turn faster, because its wheels have more room. What always holds: no
    // speed exceeds a limit unless it exceeded it before.
    #[test]
    fn no_speed_rises_above_a_limit_and_none_stays_above(
        policy in policy(), history in history(), rest in vec(moment(), 1..=10), limit in limit(),
        priority in priority(),
    ) {
        let stranger = policy.behaviors.len();
        let limit = limit.in_sector(Sector::ALL);
        let mut run = Run::with_stranger(&policy, priority);
        for moment in &history {
            run.live(moment);
        }
        // Time may have run backwards; from here on it does not.
        run.now = run.now.max(run.decision.stamp) + Duration::from_secs(2000);
        let repeat = Moment { wait_ms: 20, acts: vec![Act::Repeat; MAX_BEHAVIORS], order: u8::MAX, sensor_works: true };
        let forward = rest.into_iter().map(|moment| Moment { wait_ms: moment.wait_ms.abs(), ..moment });
        for moment in forward.chain(vec![repeat; 60]) {
            let before = run.state.commanded();
            run.prepare(&moment);
            run.put(stranger, limit, 0, 0);
            run.decide();
            assert_within(&run.decision, before, limit.axes.intersection(policy.axes()), limit.limits)?;
        }
        for axis in limit.axes.intersection(policy.axes()).iter() {
            let (speed, max) = (run.decision.commanded.get(axis).abs(), limit.limits.get(axis));
            prop_assert!(speed <= max + SLACK, "{:?} still at {} instead of {}", axis, speed, max);
        }
    }

    #[test]
    fn every_live_limit_is_respected(policy in policy(), history in history()) {
        let mut run = Run::new(&policy);
        let mut latest = Time::ZERO;
        for moment in &history {
            let before = run.state.commanded();
            run.live(&Moment { order: u8::MAX, ..moment.clone() });
            latest = latest.max(run.now);
            for (proposal, behavior) in run.proposals.iter().zip(&policy.behaviors) {
                let Some(limit) = proposal.filter(|p| is_live(p, behavior, &policy, latest)) else { continue };
                let limits = [limit.limits.linear, limit.limits.lateral, limit.limits.angular];
                let sound = limit.axes.is_valid()
                    && limits.iter().all(|speed| speed.is_finite() && *speed >= 0.0)
                    && limit.sector == Sector::ALL;
                if limit.kind() == Some(Kind::Limit) && sound {
                    assert_within(&run.decision, before, limit.axes.intersection(policy.axes()), limit.limits)?;
                }
            }
        }
    }

    #[test]
    fn falling_silent_with_a_halt_or_limit_never_raises_a_speed_within_hold(
        policy in policy(), history in history(), last in vec(moment(), 1..12),
        who in 0..MAX_BEHAVIORS, held in restraint(), clears in any::<bool>(),
    ) {
        let who = who % policy.behaviors.len();
        let mut run = Run::new(&policy);
        for moment in &history {
            run.live(moment);
        }
        run.state.enable(who);
        run.wait(20);
        run.put(who, held, 0, 0);
        run.decide();
        let proposed = run.now;
        for mut moment in last {
            moment.acts[who] = if clears { Act::Clear } else { Act::Keep };
            moment.wait_ms = moment.wait_ms.max(0);
            moment.order = u8::MAX;
            run.prepare(&moment);
            // The other author is never silent.
            let mut speaking = run.clone();
            speaking.put(who, held, 0, 0);
            let within_hold = run.now <= proposed + policy.behaviors[who].hold;
            let before = run.state.commanded();
            run.decide();
            speaking.decide();
            if within_hold || policy.behaviors[who].critical {
                assert_no_faster(&run.decision, &speaking.decision)?;
                let named = if held.axes.is_empty() { Axes::ALL } else { held.axes }.intersection(policy.axes());
                if held.kind() == Some(Kind::Halt) {
                    prop_assert_eq!(run.decision.halted.intersection(named), named);
                    assert_within(&run.decision, before, named, Twist::ZERO)?;
                } else if held.sector == Sector::ALL {
                    assert_within(&run.decision, before, named, held.limits)?;
                }
            }
        }
    }
}

/// Asserts that no axis is allowed more, and that neither the translation nor the turn is faster.
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

/// Asserts that no more than `limits` is allowed on `axes`, and that a speed exceeds them only if it did before.
fn assert_within(decision: &Decision, before: Twist, axes: Axes, limits: Twist) -> Result<(), TestCaseError> {
    for axis in axes.iter() {
        let (limit, allowed) = (limits.get(axis), decision.allowed.get(axis).abs());
        prop_assert!(allowed <= limit, "{axis:?} allowed {allowed} instead of {limit}");
        let (driven, before) = (decision.commanded.get(axis).abs(), before.get(axis).abs());
        prop_assert!(driven <= limit.max(before) + SLACK, "{axis:?} {driven} after {before}, limit {limit}");
    }
    Ok(())
}
