//! A laser scanner in place of sonars, and bumpers.

use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, Beam, Bumper, DecisionHeader, Kind, Odometry, Proposal, RangeScanHeader, Reason, Twist,
};
use yamabico_core::range_scan::LaserScanner;
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_sonar_halt::{BUMPER, DECISION, ODOMETRY, SONAR, SonarHalt};

/// Scan of `count` beams all around with free space of 3 m, but `range_m` in the directions `from_deg` to `to_deg`.
fn scan(count: usize, range_m: f32, from_deg: f64, to_deg: f64) -> Vec<Beam> {
    let step_rad = std::f64::consts::TAU / count as f64;
    let laser =
        LaserScanner { first_rad: 0.0, step_rad, min_m: 0.1, max_m: 5.0, mount: Pose2::new(0.1, 0.0, 0.0) };
    let degrees = |i: usize| 360.0 * i as f64 / count as f64;
    let is_near = |i: &usize| (from_deg..to_deg).contains(&degrees(*i));
    let ranges: Vec<f32> = (0..count).map(|i| if is_near(&i) { range_m } else { 3.0 }).collect();
    let mut beams = Vec::new();
    laser.beams(ranges.into_iter(), &mut beams).unwrap();
    beams
}

/// Feeds one reading of everything: a robot that drives and wishes to drive at these speeds, m/s.
fn propose(bench: &mut Bench<SonarHalt>, seconds: f64, beams: &[Beam], speeds: [f64; 2]) -> Proposal {
    let stamp_ns = Time::from_secs_f64(seconds).0;
    let [measured, wished] = speeds.map(|speed| Twist::planar(speed, 0.0));
    let header = RangeScanHeader { stamp_ns, max_m: 5.0, ..RangeScanHeader::default() };
    let decision = DecisionHeader { stamp_ns, wished, ..DecisionHeader::default() };
    bench.at(seconds).feed(&SONAR, &header, beams).feed(&DECISION, &decision, &[]);
    bench.feed(&ODOMETRY, &Odometry::new(stamp_ns, &Pose2::default(), &measured), &[]);
    bench.propose()
}

#[test]
fn a_laser_scanner_takes_the_place_of_sonars() {
    for count in [360, 720, 2048] {
        let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
        let aside = scan(count, 0.5, 60.0, 120.0);
        for i in 0..10 {
            let proposal = propose(&mut bench, 0.1 * f64::from(i), &aside, [0.4; 2]);
            let expected = if i < 2 { Kind::Halt } else { Kind::Abstain };
            assert_eq!(proposal.kind(), Some(expected), "{count} beams: a wall aside is not on the path");
        }
        // One beam of the scan is a pole of one degree or less.
        let pole = scan(count, 0.3, 0.0, 360.0 / count as f64);
        let halt = propose(&mut bench, 1.0, &pole, [0.4; 2]);
        assert_eq!((halt.kind(), halt.reason()), (Some(Kind::Halt), Some(Reason::Echo)), "{count} beams");
    }
}

#[test]
fn a_person_that_comes_nearer_is_seen_in_a_laser_scan() {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
    let mut slowed = None;
    for i in 0..30 {
        let seconds = 0.1 * f64::from(i);
        let person = scan(720, (2.9 - 1.0 * seconds) as f32, 50.0, 58.0);
        let proposal = propose(&mut bench, seconds, &person, [0.2; 2]);
        if i > 3 && proposal.kind() != Some(Kind::Abstain) && slowed.is_none() {
            slowed = Some((seconds, proposal.kind()));
        }
    }
    let (at_s, kind) = slowed.expect("the person is never noticed");
    assert_eq!(kind, Some(Kind::Limit));
    assert!((0.4..1.0).contains(&at_s), "noticed after {at_s} s");
}

#[test]
fn laser_scans_cost_no_memory() {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
    bench.draw();
    let beams = scan(2048, 1.0, 0.0, 90.0);
    let header = RangeScanHeader { max_m: 5.0, ..RangeScanHeader::default() };
    for i in 0..6_u32 {
        let stamp_ns = Time::from_secs_f64(0.1 * f64::from(i)).0;
        bench.at(0.1 * f64::from(i)).feed(&SONAR, &RangeScanHeader { stamp_ns, ..header }, &beams);
        bench.feed(&ODOMETRY, &Odometry::new(stamp_ns, &Pose2::default(), &Twist::planar(0.3, 0.0)), &[]);
        let (_, counted) = allocations(|| bench.propose());
        assert!(i < 2 || counted.calls == 0, "call {i}: {counted:?}");
    }
}

#[test]
fn without_any_scan_a_bumper_leaves_the_reason_of_the_halt() {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
    for (seconds, pressed, reason) in [(0.0, 1, Reason::Echo), (0.1, 0, Reason::NoInput)] {
        let bumper = Bumper { stamp_ns: Time::from_secs_f64(seconds).0, pressed, ..Bumper::default() };
        let halt = bench.at(seconds).feed(&BUMPER, &bumper, &[]).propose();
        assert_eq!((halt.kind(), halt.reason()), (Some(Kind::Halt), Some(reason)));
    }
    assert_eq!(bench.at(1.0).propose().reason(), Some(Reason::StaleInput), "a silent bumper");
    let bumper = Bumper { stamp_ns: Time::from_secs_f64(1.1).0, ..Bumper::default() };
    assert_eq!(bench.at(1.1).feed(&BUMPER, &bumper, &[]).propose().reason(), Some(Reason::NoInput));
}

#[test]
fn a_pressed_bumper_halts_until_the_robot_backs_off() {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
    let free = scan(360, 3.0, 0.0, 0.0);
    let at = |bench: &mut Bench<SonarHalt>, tenths: u32, pressed: u64, speeds: [f64; 2]| {
        let seconds = 0.1 * f64::from(tenths);
        let bumper = Bumper { stamp_ns: Time::from_secs_f64(seconds).0, pressed, ..Bumper::default() };
        bench.at(seconds).feed(&BUMPER, &bumper, &[]);
        propose(bench, seconds, &free, speeds)
    };
    for tenths in 0..4 {
        at(&mut bench, tenths, 0, [0.4; 2]);
    }
    assert_eq!(at(&mut bench, 4, 0, [0.4; 2]).kind(), Some(Kind::Abstain));
    let halt = at(&mut bench, 5, 2, [0.4; 2]);
    assert_eq!((halt.kind(), halt.axes), (Some(Kind::Halt), Axes::ALL));
    assert!(halt.note.as_str().contains("bumper"), "{:?}", halt.note);
    for tenths in 6..10 {
        assert_eq!(at(&mut bench, tenths, 2, [0.0, 0.4]).kind(), Some(Kind::Halt), "it wishes to push on");
    }
    let kinds: Vec<_> = (10..14).map(|tenths| at(&mut bench, tenths, 2, [0.0, -0.2]).kind()).collect();
    assert_eq!(kinds.last(), Some(&Some(Kind::Abstain)), "backing off is open: {kinds:?}");
    assert_eq!(at(&mut bench, 14, 2, [-0.1, 0.4]).kind(), Some(Kind::Halt));
    // Silence of a bumper that has spoken.
    let mut last = None;
    for tenths in 15..25 {
        last = propose(&mut bench, 0.1 * f64::from(tenths), &free, [0.0, -0.2]).reason();
    }
    assert_eq!(last, Some(Reason::StaleInput));
}
