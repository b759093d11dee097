//! Each rung on hand-made messages; the robot moves exactly as proposed.

use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, Axis, Beam, DecisionHeader, Kind, Mode, Obstacle, ObstaclesHeader, Odometry, Outcome, Proposal,
    RangeScanHeader, Reason, Twist, Verdict,
};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_stuck_recovery::{DECISION, OBSTACLES, ODOMETRY, SONAR, StuckRecovery};

const STEP_S: f64 = 0.05;

/// A robot whose other behaviors want `wished`.
struct Scene {
    bench: Bench<StuckRecovery>,
    now: f64,
    pose: Pose2,
    wished: Twist,
    halted: Axes,
    verdict: Verdict,
    /// Twist that the behavior last proposed.
    proposed: Option<Twist>,
}

impl Scene {
    fn new(parameters: &str) -> Self {
        let parameters = format!("progress_timeout_s = 2.0\nretry_s = 1.0\n{parameters}");
        let setup = Setup { name: "stuck-recovery".into(), ..Setup::default() };
        let driver = Verdict {
            behavior: "wall-follower".into(),
            priority: 10,
            kind: Kind::Drive.code(),
            claimed: Axes::PLANAR,
            outcome: Outcome::Won.code(),
            ..Verdict::default()
        };
        Self {
            bench: Bench::new(&parameters, setup).unwrap(),
            now: 1.0,
            pose: Pose2::default(),
            wished: Twist::planar(0.4, 0.0),
            halted: Axes::NONE,
            verdict: driver,
            proposed: None,
        }
    }

    /// Advances by one step, in which the robot moves as last proposed.
    fn step(&mut self) -> Proposal {
        self.now += STEP_S;
        let stamp_ns = Time::from_secs_f64(self.now).0;
        let (kind, claimed) = match self.proposed {
            Some(_) => (Kind::Drive, Axes::PLANAR),
            None => (Kind::Abstain, Axes::NONE),
        };
        let own = Verdict {
            behavior: "stuck-recovery".into(),
            priority: 60,
            kind: kind.code(),
            claimed,
            ..Verdict::default()
        };
        let driving = if self.proposed.is_some() { own.behavior } else { self.verdict.behavior };
        let decision = DecisionHeader {
            stamp_ns,
            wished: self.proposed.unwrap_or(self.wished),
            mode: Mode::Driving.code(),
            axes: Axes::PLANAR,
            halted: self.halted,
            halter: [if self.halted.is_empty() { "" } else { "sonar-halt" }.into(); 3],
            source: [driving, "".into(), driving],
            ..DecisionHeader::default()
        };
        let odometry = Odometry::new(stamp_ns, &self.pose, &Twist::ZERO);
        self.bench.at(self.now).feed(&DECISION, &decision, &[self.verdict, own]).feed(
            &ODOMETRY,
            &odometry,
            &[],
        );
        let proposal = self.bench.propose();
        let drives = proposal.kind() == Some(Kind::Drive);
        self.proposed = drives.then_some(proposal.twist);
        if drives {
            self.pose = self.pose.integrate(&proposal.twist, STEP_S);
        }
        proposal
    }

    /// Runs until the behavior has driven and abstains again. Returns its first proposal to drive.
    fn rung(&mut self) -> Proposal {
        let mut first = None;
        for _ in 0..2000 {
            let proposal = self.step();
            match (proposal.kind(), first) {
                (Some(Kind::Drive), None) => first = Some(proposal),
                (Some(Kind::Abstain), Some(first)) => return first,
                _ => {}
            }
        }
        panic!("no rung ended within {} s", 2000.0 * STEP_S);
    }

    fn scan(&mut self, degrees_and_ranges: &[(f64, f64)]) {
        let stamp_ns = Time::from_secs_f64(self.now).0;
        let header = RangeScanHeader { stamp_ns, ..RangeScanHeader::default() };
        let beams: Vec<Beam> = degrees_and_ranges
            .iter()
            .map(|(degrees, range_m)| Beam {
                azimuth_rad: degrees.to_radians(),
                range_m: *range_m,
                ..Beam::default()
            })
            .collect();
        self.bench.feed(&SONAR, &header, &beams);
    }
}

#[test]
fn a_robot_that_progresses_or_wants_to_stand_is_left_alone() {
    let mut scene = Scene::new("");
    for _ in 0..200 {
        scene.pose.x += 0.4 * STEP_S;
        assert_eq!(scene.step().kind(), Some(Kind::Abstain));
    }
    scene.wished = Twist::ZERO;
    for _ in 0..200 {
        assert_eq!(scene.step().reason(), Some(Reason::Clear), "arrived");
    }
}

#[test]
fn a_robot_that_only_looks_about_is_stuck() {
    let mut scene = Scene::new("");
    scene.verdict.reason = Reason::Searching.code();
    for step in 0..60 {
        // A search stands between two looks.
        scene.wished = Twist::planar(0.0, if step % 7 < 3 { 0.3 } else { 0.0 });
        if scene.step().kind() == Some(Kind::Drive) {
            return;
        }
    }
    panic!("no rung was tried");
}

#[test]
fn standing_rungs_stand_until_it_has_stood_for_their_time_and_tell_the_rung() {
    let mut scene =
        Scene::new("ladder = ['wait', 'look-again', 'ask']\nwait_s = 3.0\nlook_s = 5.0\nask_s = 2.0");
    for (note, reason) in [
        ("1 of 3, wait, 0.0 s", Reason::Searching),
        ("2 of 3, look-again, 0.0 s", Reason::Searching),
        ("3 of 3, ask: please help, stuck again for 1 s", Reason::PassageBlocked),
        ("3 of 3, ask: please help, stuck again for 1 s", Reason::PassageBlocked),
    ] {
        let first = scene.rung();
        assert_eq!((first.note.as_str(), first.reason()), (note, Some(reason)));
        assert_eq!((first.twist, first.axes), (Twist::ZERO, Axes::PLANAR));
    }
    assert_eq!(scene.pose, Pose2::default());
}

#[test]
fn it_turns_to_the_side_with_more_room_and_then_to_the_other() {
    for (left_m, right_m, sign) in [(2.0, 0.5, 1.0), (0.5, 2.0, -1.0)] {
        let mut scene = Scene::new("ladder = ['turn', 'other-side']\nstale_ms = 2000.0");
        for _ in 0..39 {
            scene.step();
        }
        scene.scan(&[(35.0, left_m), (0.0, 0.4), (-35.0, right_m)]);
        scene.rung();
        assert!((scene.pose.theta.to_degrees() - sign * 25.0).abs() < 4.0, "{}", scene.pose.theta);
        scene.rung();
        assert!((scene.pose.theta.to_degrees() + sign * 25.0).abs() < 7.0, "{}", scene.pose.theta);
        assert_eq!((scene.pose.x, scene.pose.y), (0.0, 0.0), "no room ahead, and none known");
    }
}

#[test]
fn it_drives_ahead_on_the_other_side_where_the_sonar_shows_room() {
    let mut scene = Scene::new("ladder = ['other-side']\nstale_ms = 2000.0");
    for _ in 0..145 {
        scene.scan(&[(0.0, 3.0)]);
        scene.step();
    }
    let distance_m = scene.pose.distance(&Pose2::default());
    assert!((distance_m - 0.4).abs() < 0.05, "{distance_m}");
}

#[test]
fn it_does_not_drive_ahead_where_an_obstacle_gives_no_echo() {
    let mut scene = Scene::new("ladder = ['other-side']\nstale_ms = 2000.0");
    for sequence in 1..=145 {
        scene.scan(&[(0.0, 3.0)]);
        let header = ObstaclesHeader {
            stamp_ns: Time::from_secs_f64(scene.now).0,
            sequence,
            ..ObstaclesHeader::default()
        };
        let flank = Obstacle { x: 0.6, y: 0.1, radius_m: 0.1, ..Obstacle::default() };
        scene.bench.feed(&OBSTACLES, &header, &[flank]);
        scene.step();
    }
    assert!(scene.pose.theta.to_degrees() < -40.0, "it turns");
    assert_eq!(scene.pose.position(), Pose2::default().position());
}

#[test]
fn it_does_not_drive_ahead_after_a_halt() {
    for halted in [Axes::from(Axis::Linear), Axes::PLANAR] {
        drive_ahead_until_a_halt(halted);
    }
}

fn drive_ahead_until_a_halt(halted: Axes) {
    let mut scene = Scene::new("ladder = ['other-side']\nstale_ms = 2000.0");
    let mut at_halt = None;
    for _ in 0..145 {
        scene.scan(&[(0.0, 3.0)]);
        let proposal = scene.step();
        if proposal.twist.linear > 0.0 && scene.pose.distance(&Pose2::default()) > 0.1 {
            scene.halted = halted;
            at_halt.get_or_insert(scene.pose);
        } else if at_halt.is_some() {
            scene.halted = Axes::NONE;
        }
    }
    assert_eq!(scene.pose.position(), at_halt.unwrap().position());
}

#[test]
fn it_backs_off_only_along_the_way_on_which_it_came() {
    let mut scene = Scene::new("ladder = ['back-off']");
    scene.pose.theta = 0.5;
    for _ in 0..40 {
        scene.pose = scene.pose.integrate(&Twist::planar(0.4, 0.3), STEP_S);
        scene.step();
    }
    let stuck = scene.pose;
    let way: Vec<Pose2> =
        (0..40).map(|i| stuck.integrate(&Twist::planar(0.4, 0.3), -STEP_S * f64::from(i))).collect();
    scene.rung();
    let backed_m = scene.pose.distance(&stuck);
    assert!((0.4..0.55).contains(&backed_m), "{backed_m}");
    let beside_m = way.iter().map(|pose| pose.distance(&scene.pose)).fold(f64::INFINITY, f64::min);
    assert!(beside_m < 0.04, "{beside_m}");

    let mut scene = Scene::new("ladder = ['back-off']");
    for _ in 0..200 {
        scene.step();
    }
    assert_eq!(scene.pose, Pose2::default(), "it has been nowhere else");
}

#[test]
fn it_wishes_to_back_off_from_what_halts_it_and_gives_up() {
    let mut scene = Scene::new("ladder = ['wait', 'back-off']\nback_m = 0.3");
    for _ in 0..40 {
        scene.pose.x += 0.4 * STEP_S;
        scene.step();
    }
    let touching = scene.pose;
    scene.halted = Axes::ALL;
    let mut step = || {
        let proposal = scene.step();
        // The robot stays: the halt is not lifted.
        scene.pose = touching;
        proposal
    };
    let waits = (0..100).take_while(|_| step().kind() == Some(Kind::Abstain)).count();
    assert!((35..=40).contains(&waits), "{waits}");
    let back = step();
    assert!(back.twist.linear < 0.0 && back.note.as_str().starts_with("2 of 2, back-off"), "{back:?}");
    let wishes = (0..200).take_while(|_| step().kind() == Some(Kind::Drive)).count();
    assert!((80..=120).contains(&wishes), "{wishes}");
    assert_eq!(step().reason(), Some(Reason::PassageBlocked), "it waits again");
}

#[test]
fn it_does_not_back_off_into_what_a_sonar_behind_sees() {
    let mut scene = Scene::new("ladder = ['back-off']\nstale_ms = 2000.0");
    for _ in 0..40 {
        scene.pose.x += 0.4 * STEP_S;
        scene.step();
    }
    let stuck = scene.pose;
    for _ in 0..100 {
        scene.scan(&[(0.0, 0.3), (180.0, 0.1)]);
        scene.step();
    }
    assert_eq!(scene.pose, stuck);
}

#[test]
fn a_halt_is_never_fought() {
    let mut scene = Scene::new("ladder = ['turn']");
    scene.halted = Axes::ALL;
    for _ in 0..400 {
        let proposal = scene.step();
        assert_eq!(proposal.kind(), Some(Kind::Abstain));
    }
    let waiting = scene.step();
    assert_eq!(waiting.note.as_str(), "waiting for 20 s, halted by sonar-halt");
    scene.halted = Axes::from(Axis::Linear);
    for _ in 0..19 {
        assert_eq!(scene.step().kind(), Some(Kind::Abstain), "the others have their time");
    }
    scene.step();
    assert_eq!(scene.step().kind(), Some(Kind::Drive), "turning is free");
    scene.halted = Axes::ALL;
    assert_eq!(scene.step().note.as_str(), "1 of 1, turn: waits, sonar-halt halts");
}

#[test]
fn it_ends_when_nobody_wants_to_drive_any_more() {
    let arrived = |verdict: Verdict| Verdict {
        kind: Kind::Abstain.code(),
        claimed: Axes::NONE,
        outcome: Outcome::Abstained.code(),
        reason: Reason::Clear.code(),
        ..verdict
    };
    let stale = |verdict: Verdict| Verdict {
        outcome: Outcome::Stale.code(),
        fault: Outcome::Stale.code(),
        ..verdict
    };
    for end in [arrived, stale] {
        let mut scene = Scene::new("ladder = ['ask']\nask_s = 60.0");
        while scene.step().kind() != Some(Kind::Drive) {}
        for _ in 0..100 {
            assert_eq!(scene.step().kind(), Some(Kind::Drive), "the others wait behind it");
        }
        scene.verdict = end(scene.verdict);
        scene.wished = Twist::ZERO;
        let goes_on = (0..200).take_while(|_| scene.step().kind() == Some(Kind::Drive)).count();
        assert!((18..=21).contains(&goes_on), "{goes_on} steps");
        for _ in 0..100 {
            assert_eq!(scene.step().kind(), Some(Kind::Abstain));
        }
    }
}

#[test]
fn a_higher_priority_is_not_disturbed() {
    let mut scene = Scene::new("");
    scene.verdict.priority = 70;
    for _ in 0..400 {
        assert_eq!(scene.step().kind(), Some(Kind::Abstain), "the operator pushes against a wall");
    }
}

#[test]
fn who_sees_too_little_to_drive_is_stuck_too() {
    let mut scene = Scene::new("");
    scene.wished = Twist::ZERO;
    scene.verdict = Verdict {
        kind: Kind::Abstain.code(),
        claimed: Axes::NONE,
        outcome: Outcome::Abstained.code(),
        reason: Reason::NoVanishingPoint.code(),
        ..scene.verdict
    };
    assert_eq!(scene.rung().note.as_str(), "3 of 6, turn, 0.0 s", "it has stood long enough");
}

#[test]
fn missing_and_stale_inputs_abstain() {
    let mut bench = Bench::<StuckRecovery>::new("", Setup::default()).unwrap();
    assert_eq!(bench.at(1.0).propose().reason(), Some(Reason::NoInput));
    let mut scene = Scene::new("");
    scene.step();
    assert_eq!(scene.bench.at(scene.now + 0.5).propose().reason(), Some(Reason::StaleInput));
    let refused = Bench::<StuckRecovery>::new("away_m = 0.4", Setup::default()).err().unwrap();
    assert_eq!(refused.key, "away_m");
}

#[test]
fn a_time_without_inputs_is_no_time_in_which_the_robot_stood() {
    let mut scene = Scene::new("ladder = ['ask']");
    for _ in 0..10 {
        scene.step();
    }
    for _ in 0..40 {
        scene.now += 0.1;
        assert_ne!(scene.bench.at(scene.now).propose().kind(), Some(Kind::Drive));
    }
    let abstained = (0..100).take_while(|_| scene.step().kind() == Some(Kind::Abstain)).count();
    assert!((39..=41).contains(&abstained), "stuck after {abstained} steps, and not after 2 s");
}

#[test]
fn a_rung_that_watches_the_room_is_as_old_as_what_it_sees() {
    for (rung, oldest_s) in [("other-side", Some(0.1)), ("back-off", Some(0.1)), ("ask", None)] {
        let mut scene = Scene::new(&format!("ladder = ['{rung}']"));
        for sequence in 1..200 {
            scene.pose.x += if sequence < 40 { 0.4 * STEP_S } else { 0.0 };
            scene.scan(&[(0.0, 3.0)]);
            let stamp = Time::from_secs_f64(scene.now + STEP_S);
            let evidence_ns = Time::from_secs_f64(scene.now + STEP_S - 0.1).0;
            let header = ObstaclesHeader { stamp_ns: stamp.0, evidence_ns, sequence };
            scene.bench.at(scene.now + STEP_S).feed(&OBSTACLES, &header, &[]);
            let proposal = scene.step();
            if proposal.kind() == Some(Kind::Drive) {
                let age_s = Time::from_secs_f64(scene.now).seconds_after(Time(proposal.evidence_ns));
                assert!((age_s - oldest_s.unwrap_or_default()).abs() < 1e-6, "{rung}: {age_s} s");
                break;
            }
            assert!(sequence < 199, "{rung} is never tried");
        }
    }
}

#[test]
fn a_jump_of_the_odometry_ends_the_attempt_and_leaves_no_way_back() {
    for jump in [Pose2::new(-3.0, 1.0, 0.0), Pose2::new(0.0, 0.0, 2.0)] {
        let mut scene = Scene::new("ladder = ['back-off']");
        for _ in 0..40 {
            scene.pose.x += 0.4 * STEP_S;
            scene.step();
        }
        let backs_off = |scene: &mut Scene| (0..60).any(|_| scene.step().kind() == Some(Kind::Drive));
        assert!(backs_off(&mut scene));
        scene.pose = scene.pose * jump;
        assert_eq!(scene.step().kind(), Some(Kind::Abstain));
        assert!(!backs_off(&mut scene), "it knows no way on which it came");
    }
}

#[test]
fn propose_does_not_allocate() {
    let mut scene = Scene::new("");
    for i in 0..600 {
        let stamp_ns = Time::from_secs_f64(scene.now + STEP_S).0;
        scene.step();
        let odometry = Odometry::new(stamp_ns + 1, &scene.pose, &Twist::ZERO);
        scene.bench.feed(&ODOMETRY, &odometry, &[]);
        let (_, counted) = allocations(|| scene.bench.propose());
        assert_eq!(counted.calls, 0, "call {i}");
    }
}
