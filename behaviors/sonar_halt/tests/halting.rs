//! Halts by range alone: the robot's motion is not known.

use yamabico_core::behavior::Setup;
use yamabico_core::message::{Axes, Axis, Beam, Kind, NO_ECHO, Proposal, RangeScanHeader, Reason};
use yamabico_core::sensor::{SensorInfo, SensorKind};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_sonar_halt::{SONAR, SonarHalt};

fn bench() -> Bench<SonarHalt> {
    Bench::new("gate_m = 0.5", Setup::default()).expect("a valid configuration")
}

fn scan_at(bench: &mut Bench<SonarHalt>, seconds: f64, ranges: &[f64]) -> Proposal {
    let header = RangeScanHeader { stamp_ns: Time::from_secs_f64(seconds).0, ..RangeScanHeader::default() };
    let beams: Vec<Beam> = ranges
        .iter()
        .map(|&range_m| Beam {
            range_m,
            x_m: 0.2,
            flags: if range_m > 10.0 { NO_ECHO } else { 0 },
            ..Beam::default()
        })
        .collect();
    bench.at(seconds).feed(&SONAR, &header, &beams).propose()
}

fn is_halt(proposal: &Proposal, reason: Reason) -> bool {
    proposal.kind() == Some(Kind::Halt) && proposal.reason() == Some(reason)
}

fn released() -> Bench<SonarHalt> {
    let mut bench = bench();
    for i in 0..3 {
        scan_at(&mut bench, 0.1 * f64::from(i), &[99.0, 2.0, 0.5]);
    }
    assert_eq!(bench.propose().kind(), Some(Kind::Abstain));
    bench
}

#[test]
fn halts_until_the_sonar_speaks() {
    let mut bench = bench();
    let first = bench.propose();
    assert!(is_halt(&first, Reason::NoInput));
    assert_eq!(first.axes, Axes::ALL);
    assert_eq!(scan_at(&mut bench, 0.0, &[2.0]).kind(), Some(Kind::Halt));
    assert_eq!(scan_at(&mut bench, 0.1, &[2.0]).kind(), Some(Kind::Halt));
    assert_eq!(scan_at(&mut bench, 0.2, &[2.0]).reason(), Some(Reason::Clear));
}

#[test]
fn one_echo_halts_and_three_clean_scans_release() {
    let mut bench = released();
    let halt = scan_at(&mut bench, 0.3, &[99.0, 0.499, 99.0]);
    assert!(is_halt(&halt, Reason::Echo));
    assert!(!halt.axes.contains(Axis::Angular), "turning in place stays open");
    assert!(is_halt(&scan_at(&mut bench, 0.4, &[2.0]), Reason::Echo));
    assert!(is_halt(&scan_at(&mut bench, 0.5, &[0.4]), Reason::Echo));
    for (i, kind) in [Kind::Halt, Kind::Halt, Kind::Abstain].into_iter().enumerate() {
        assert_eq!(scan_at(&mut bench, 0.6 + 0.1 * i as f64, &[0.5]).kind(), Some(kind));
    }
}

#[test]
fn an_echo_at_the_footprint_closes_turning() {
    let mut bench = released();
    assert_eq!(scan_at(&mut bench, 0.3, &[0.05]).axes, Axes::ALL);
}

#[test]
fn silence_halts_after_three_hundred_milliseconds() {
    let mut bench = released();
    assert_eq!(bench.at(0.499).propose().kind(), Some(Kind::Abstain));
    assert!(is_halt(&bench.at(0.51).propose(), Reason::SonarStale));
    assert_eq!(scan_at(&mut bench, 0.52, &[2.0]).kind(), Some(Kind::Halt));
}

#[test]
fn a_scan_that_is_old_on_arrival_does_not_release() {
    let mut bench = bench();
    for i in 0..5 {
        let stamp_ns = Time::from_secs_f64(f64::from(i) * 0.1).0;
        let header = RangeScanHeader { stamp_ns, ..RangeScanHeader::default() };
        bench.at(5.0 + f64::from(i) * 0.1).feed(&SONAR, &header, &[Beam { range_m: 2.0, ..Beam::default() }]);
        assert!(is_halt(&bench.propose(), Reason::SonarStale));
    }
}

#[test]
fn lost_scans_count_as_an_echo() {
    let mut bench = released();
    bench.lose(&SONAR, 1);
    assert!(is_halt(&scan_at(&mut bench, 0.3, &[2.0]), Reason::Overflow));
    assert_eq!(scan_at(&mut bench, 0.4, &[2.0]).kind(), Some(Kind::Halt));
    assert_eq!(scan_at(&mut bench, 0.5, &[2.0]).kind(), Some(Kind::Abstain));
}

#[test]
fn broken_scans_are_named_and_halt() {
    for ranges in [&[][..], &[f64::NAN][..], &[2.0, -1.0][..]] {
        let mut bench = released();
        assert!(is_halt(&scan_at(&mut bench, 0.3, ranges), Reason::MalformedInput), "{ranges:?}");
    }
    let mut bench = released();
    let header = RangeScanHeader { stamp_ns: Time::from_secs_f64(9.0).0, ..RangeScanHeader::default() };
    bench.at(0.3).feed(&SONAR, &header, &[Beam { range_m: 2.0, ..Beam::default() }]);
    assert!(is_halt(&bench.propose(), Reason::MalformedInput), "a stamp from the future");
}

#[test]
fn a_repeated_scan_is_no_further_clean_reading() {
    let mut bench = bench();
    for _ in 0..5 {
        assert_eq!(scan_at(&mut bench, 0.0, &[2.0]).kind(), Some(Kind::Halt));
    }
}

#[test]
fn parameters_are_checked() {
    let refused = |toml: &str| Bench::<SonarHalt>::new(toml, Setup::default()).err().map(|error| error.key);
    assert_eq!(refused("gate_m = 0.0").as_deref(), Some("gate_m"));
    assert_eq!(refused("stale_ms = 1e9").as_deref(), Some("stale_ms"));
    assert_eq!(refused("clean_readings = 0").as_deref(), Some("clean_readings"));
    assert!(refused("gate = 0.5").is_some());
    let sonar = SensorInfo {
        name: "front-sonar".into(),
        message: "yamabico.RangeScanHeader.v1",
        period_s: 0.05,
        latency_s: 0.0,
        kind: SensorKind::Range { min_m: 0.02, max_m: 0.4 },
    };
    let setup = Setup { sensors: vec![("sonar".into(), sonar)], ..Setup::default() };
    assert_eq!(
        Bench::<SonarHalt>::new("gate_m = 0.5", setup).err().map(|e| e.key).as_deref(),
        Some("gate_m")
    );
}
