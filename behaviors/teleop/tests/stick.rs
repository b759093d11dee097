//! The behavior on a stick held by hand.

use yamabico_core::behavior::Setup;
use yamabico_core::message::{Axes, Kind, Proposal, Reason, Stick};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_teleop::{STICK, Teleop};

fn setup() -> Setup {
    let robot = Robot { axes: Axes::PLANAR, ..Robot::default() };
    Setup { robot, ..Setup::default() }
}

fn bench() -> Bench<Teleop> {
    Bench::new("speed_mps = 0.4\nturn_radps = 1.0", setup()).expect("a valid configuration")
}

fn hold(bench: &mut Bench<Teleop>, seconds: f64, forward: f64, turn: f64) -> Proposal {
    let stick = Stick { stamp_ns: Time::from_secs_f64(seconds).0, forward, turn, ..Stick::default() };
    bench.at(seconds).feed(&STICK, &stick, &[]).propose()
}

#[test]
fn drives_while_the_stick_is_held() {
    let mut bench = bench();
    assert_eq!(bench.propose().reason(), Some(Reason::NoInput));
    let drive = hold(&mut bench, 1.0, 0.5, -1.0);
    assert_eq!((drive.kind(), drive.axes), (Some(Kind::Drive), Axes::PLANAR));
    assert_eq!((drive.twist.linear, drive.twist.angular), (0.2, -1.0));
    assert_eq!(drive.evidence_ns, Time::from_secs_f64(1.0).0);
}

#[test]
fn a_hand_that_lets_go_is_a_dead_man() {
    let mut bench = bench();
    hold(&mut bench, 1.0, 1.0, 0.0);
    assert_eq!(bench.at(1.29).propose().kind(), Some(Kind::Drive));
    let abstain = bench.at(1.31).propose();
    assert_eq!((abstain.kind(), abstain.reason()), (Some(Kind::Abstain), Some(Reason::StaleInput)));
    assert_eq!(hold(&mut bench, 2.0, 0.0, 0.0).kind(), Some(Kind::Drive), "held in the middle it stands");
}

#[test]
fn a_stick_that_is_held_nowhere_or_tomorrow_drives_nothing() {
    let mut bench = bench();
    for (at, forward) in [(1.0, f64::NAN), (1.1, 1e38), (1.2, -1.01)] {
        assert_eq!(hold(&mut bench, at, forward, 0.0).reason(), Some(Reason::MalformedInput), "{forward}");
    }
    let stick = Stick { stamp_ns: Time::from_secs_f64(9.0).0, forward: 1.0, ..Stick::default() };
    assert_eq!(bench.at(2.0).feed(&STICK, &stick, &[]).propose().kind(), Some(Kind::Abstain));
}
