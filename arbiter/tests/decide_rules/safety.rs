//! Stops that no behavior can override.

use super::*;

fn guarded() -> Bench {
    two_with(|policy| policy.behaviors[0].critical = true)
}

#[test]
fn nothing_moves_before_a_critical_behavior_proposes() {
    let mut bench = guarded();
    bench.propose(1, forward(0.5)).decide();
    assert_eq!((bench.decision.mode, bench.decision.commanded), (Mode::CriticalSilent, Twist::ZERO));
    assert_eq!(bench.decision.stop, Some(Stop::Behavior(0)));
    bench.propose(0, Proposal::abstain(Reason::Clear));
    assert_eq!(bench.decide().mode, Mode::Driving);
}

#[test]
fn a_critical_behavior_silent_past_its_deadline_stops_the_robot() {
    let mut bench = guarded();
    bench.propose(0, Proposal::abstain(Reason::Clear)).propose(1, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.after(ms(300)).propose(1, forward(0.5));
    assert_eq!(bench.decide().mode, Mode::Driving);
    let before = bench.decision.commanded.linear;
    bench.after(ms(1)).propose(1, forward(0.5)).decide();
    assert_eq!((bench.decision.mode, bench.outcome(1)), (Mode::CriticalSilent, Outcome::Stopped));
    assert!((before - bench.decision.commanded.linear - 0.002).abs() < 1e-9);
}

#[test]
fn a_critical_behavior_with_only_stale_proposals_is_silent() {
    let mut bench = guarded();
    for _ in 0..30 {
        bench.after(TICK);
        let stamp_ns = bench.now.0 - 300_000_000;
        bench.propose(0, Proposal { stamp_ns, ..Proposal::abstain(Reason::Clear) }).propose(1, forward(0.5));
        assert_eq!(bench.decide().mode, Mode::CriticalSilent);
    }
}

#[test]
fn a_disabled_critical_behavior_counts_as_silent() {
    let mut bench = guarded();
    bench.propose(0, Proposal::abstain(Reason::Clear)).propose(1, forward(0.5)).decide();
    bench.state.disable(0);
    bench.after(ms(301)).propose(0, Proposal::abstain(Reason::Clear)).propose(1, forward(0.5));
    assert_eq!(bench.decide().mode, Mode::CriticalSilent);
}

#[test]
fn a_stale_critical_sensor_stops_the_robot() {
    let mut bench = two_with(|policy| {
        policy.sensors = vec![CriticalSensor { name: "sonar".into(), max_age: ms(150) }];
    });
    bench.propose(1, forward(0.5)).decide();
    assert_eq!(bench.decision.stop, Some(Stop::Sensor(0)));
    bench.state.sensor_measured(0, bench.now);
    assert_eq!(bench.after(ms(150)).decide().mode, Mode::Driving);
    assert_eq!(bench.after(ms(1)).decide().stop, Some(Stop::Sensor(0)));
    assert_eq!(bench.decision.header(&bench.policy).note.as_str(), "sonar is silent");
    bench.state.sensor_measured(0, bench.now + ms(50));
    assert_eq!(bench.decide().stop, Some(Stop::Sensor(0)));
}

#[test]
fn the_emergency_stop_is_latched_until_reset() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.state.emergency_stop();
    let speed = bench.decision.commanded.linear;
    assert!((speed - bench.repeat_for(TICK).commanded.linear - 0.04).abs() < 1e-9);
    let decision = bench.repeat_for(ms(5000));
    assert_eq!((decision.mode, decision.commanded), (Mode::EmergencyStop, Twist::ZERO));
    assert!(decision.emergency);
    bench.state.reset();
    assert_eq!(bench.repeat_for(ms(100)).mode, Mode::Driving);
}

#[test]
fn the_end_of_a_run_brakes_gently_and_stays() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.state.shut_down();
    bench.state.reset();
    let decision = bench.repeat_for(TICK).clone();
    assert_eq!((decision.mode, decision.emergency), (Mode::ShuttingDown, false));
    assert!((decision.commanded.linear - 0.48).abs() < 1e-9);
    assert_eq!(bench.repeat_for(ms(1000)).commanded, Twist::ZERO);
    assert_eq!(bench.outcome(1), Outcome::Stopped);
}

#[test]
fn time_that_runs_backwards_brakes() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.5)).decide();
    bench.repeat_for(ms(2000));
    bench.now = bench.now - ms(1000);
    bench.propose(1, forward(0.9));
    let decision = bench.decide();
    assert_eq!(decision.stop, Some(Stop::Clock));
    assert!((decision.commanded.linear - 0.46).abs() < 1e-9);
    assert_eq!(bench.repeat_for(ms(500)).commanded, Twist::ZERO);
    assert_eq!(bench.repeat_for(ms(700)).mode, Mode::Driving);
}

#[test]
fn after_a_gap_the_robot_speeds_up_by_two_periods_at_most() {
    let mut bench = Bench::differential(two());
    bench.propose(1, forward(0.9)).decide();
    bench.repeat_for(ms(100));
    let before = bench.decision.commanded.linear;
    bench.after(ms(1000)).propose(1, forward(0.9));
    let gained = bench.decide().commanded.linear - before;
    assert!((gained - 0.5 * 0.04).abs() < 1e-9, "{gained}");
}

#[test]
fn missing_slots_are_silence_and_every_decision_commands() {
    let mut bench = guarded();
    bench.proposals.clear();
    for sequence in 1..10 {
        assert_eq!(bench.decide().sequence, sequence);
    }
}
