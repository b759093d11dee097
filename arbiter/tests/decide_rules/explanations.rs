//! Decisions as messages and as explanations.

use super::*;

#[test]
fn a_decision_message_has_names() {
    let mut bench = Bench::differential(two());
    bench.propose(0, halt()).propose(1, forward(0.5)).decide();
    let command = bench.decision.command(&bench.policy);
    assert_eq!((command.source[0].as_str(), command.source[1].as_str()), ("low", ""));
    let header = bench.decision.header(&bench.policy);
    assert_eq!(header.mode(), Some(Mode::Halted));
    assert_eq!(header.note.as_str(), "high halts linear+angular");
    let mut verdicts = [Verdict::default(); 3];
    assert_eq!(bench.decision.write_verdicts(&bench.policy, &mut verdicts), 2);
    assert_eq!((verdicts[0].behavior.as_str(), verdicts[0].priority), ("high", 100));
    assert_eq!((verdicts[1].by.as_str(), verdicts[1].outcome()), ("high", Some(Outcome::Stopped)));
    assert_eq!(verdicts[1].kind, Kind::Drive.code());
}

#[test]
fn an_explanation_has_a_line_for_each_axis_and_behavior() {
    let mut behaviors = two();
    behaviors.push(BehaviorPolicy::new("guard", 1));
    let mut bench = Bench::differential(behaviors);
    bench.propose(0, forward(0.5)).propose(1, turn(0.5)).propose(2, slow(0.2));
    bench.decide();
    assert_eq!(
        bench.why(),
        "driving\n  \
         linear    0.01 m/s    high asks for 0.50; guard limits it to 0.20; speeding up to 0.20\n  \
         angular   0.00 rad/s  high asks for 0.00\n  \
         high (100)  drives linear+angular\n  \
         low (10)    outranked on angular by high (100): asks for 0.50 rad/s\n  \
         guard (1)   limits linear to 0.20 m/s: wall near\n"
    );
}
