//! Halts along the path, with odometry and decisions connected.

use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, Axis, Beam, DecisionHeader, Kind, NO_ECHO, Odometry, Proposal, RangeScanHeader, Reason, Twist,
};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_sonar_halt::{DECISION, ODOMETRY, SONAR, SonarHalt};

const STEP_S: f64 = 0.05;

/// A robot with three sonars that is scanned 20 times a second.
struct Scene {
    bench: Bench<SonarHalt>,
    now: f64,
    measured: Twist,
    wished: Option<Twist>,
}

impl Scene {
    fn new(parameters: &str) -> Self {
        Self::with(parameters, Robot::default())
    }

    fn with(parameters: &str, robot: Robot) -> Self {
        let robot = Robot { radius_m: 0.2, ..robot };
        let bench = Bench::new(parameters, Setup { robot, ..Setup::default() }).unwrap();
        let mut scene = Self { bench, now: 0.0, measured: Twist::ZERO, wished: Some(Twist::ZERO) };
        for _ in 0..3 {
            scene.scan([None; 3]);
        }
        scene
    }

    /// Scans with these ranges at 35, 0 and -35 degrees, none as no echo.
    fn scan(&mut self, ranges: [Option<f64>; 3]) -> Proposal {
        self.now += STEP_S;
        let stamp_ns = Time::from_secs_f64(self.now).0;
        let beams = [35_f64, 0.0, -35.0].map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Beam { azimuth_rad: degrees.to_radians(), x_m: 0.2 * cos, y_m: 0.2 * sin, ..Beam::default() }
        });
        let beams: Vec<Beam> = beams
            .into_iter()
            .zip(ranges)
            .map(|(beam, range)| Beam {
                range_m: range.unwrap_or_default(),
                cone_rad: 22_f64.to_radians(),
                flags: if range.is_some() { 0 } else { NO_ECHO },
                ..beam
            })
            .collect();
        let header = RangeScanHeader { stamp_ns, ..RangeScanHeader::default() };
        self.bench.at(self.now).feed(&SONAR, &header, &beams);
        self.move_on()
    }

    /// Calls the behavior with the current motion and no new scan.
    fn move_on(&mut self) -> Proposal {
        let stamp_ns = Time::from_secs_f64(self.now).0;
        let odometry = Odometry::new(stamp_ns, &Pose2::default(), &self.measured);
        self.bench.at(self.now).feed(&ODOMETRY, &odometry, &[]);
        if let Some(wished) = self.wished {
            let decision = DecisionHeader { stamp_ns, wished, ..DecisionHeader::default() };
            self.bench.feed(&DECISION, &decision, &[]);
        }
        self.bench.propose()
    }
}

const AHEAD: [Option<f64>; 3] = [None, Some(0.3), None];

#[test]
fn walls_beside_a_narrow_passage_do_not_halt_and_one_across_it_does() {
    let mut scene = Scene::new("");
    (scene.measured, scene.wished) = (Twist::planar(0.4, 0.0), Some(Twist::planar(0.4, 0.0)));
    for _ in 0..5 {
        assert_eq!(scene.scan([Some(0.42), None, Some(0.42)]).kind(), Some(Kind::Abstain));
    }
    let halt = scene.scan(AHEAD);
    assert_eq!((halt.kind(), halt.reason()), (Some(Kind::Halt), Some(Reason::Echo)));
    assert!(!halt.axes.contains(Axis::Angular), "turning in place stays open");
    assert_eq!(halt.note.as_str(), "echo at 0.30 m, 0.22 m to contact; 3 clean scans to release");
    let mut scene = Scene::new("gate = 'range'");
    assert_eq!(scene.scan([Some(0.42), None, Some(0.42)]).kind(), Some(Kind::Halt), "the old gate");
}

#[test]
fn a_robot_that_stands_is_held_by_its_wish_and_released_by_another() {
    let mut scene = Scene::new("");
    assert_eq!(scene.scan(AHEAD).kind(), Some(Kind::Abstain), "nobody wants to drive");
    scene.wished = Some(Twist::planar(0.4, 0.0));
    assert_eq!(scene.move_on().kind(), Some(Kind::Halt), "at once, without a new scan");
    for _ in 0..10 {
        assert_eq!(scene.scan(AHEAD).kind(), Some(Kind::Halt));
    }
    for wished in [Twist::planar(-0.15, 0.0), Twist::planar(0.0, 0.5)] {
        scene.wished = Some(Twist::planar(0.4, 0.0));
        assert_eq!(scene.scan(AHEAD).kind(), Some(Kind::Halt));
        scene.wished = Some(wished);
        let kinds = [scene.scan(AHEAD), scene.scan(AHEAD), scene.scan(AHEAD)].map(|proposal| proposal.kind());
        assert_eq!(kinds, [Kind::Halt, Kind::Halt, Kind::Abstain].map(Some), "{wished:?}");
    }
}

#[test]
fn an_unknown_wish_is_to_drive_ahead_and_an_unknown_motion_leaves_the_gate() {
    let mut scene = Scene::new("gate_m = 0.5");
    scene.now += 1.0;
    scene.wished = None;
    assert_eq!(scene.scan([None, Some(0.45), None]).kind(), Some(Kind::Halt), "0.6 m/s straight ahead");
    for _ in 0..3 {
        scene.scan([Some(0.45), None, None]);
    }
    assert_eq!(scene.move_on().kind(), Some(Kind::Abstain), "beside a straight path");
    scene.measured = Twist::planar(f64::NAN, 0.0);
    assert_eq!(scene.move_on().kind(), Some(Kind::Halt), "not finite: any echo below the gate");
}

#[test]
fn a_wish_that_is_not_finite_or_old_is_unknown() {
    for (age_s, wished) in [(0.0, f64::NAN), (0.5, 0.0)] {
        let mut scene = Scene::new("");
        scene.wished = None;
        scene.now += 1.0;
        let stamp_ns = Time::from_secs_f64(scene.now + STEP_S - age_s).0;
        let decision =
            DecisionHeader { stamp_ns, wished: Twist::planar(wished, 0.0), ..DecisionHeader::default() };
        scene.bench.feed(&DECISION, &decision, &[]);
        assert_eq!(scene.scan(AHEAD).kind(), Some(Kind::Halt), "{age_s} s, {wished} m/s");
    }
}

#[test]
fn who_walks_up_from_the_side_slows_the_robot_and_then_halts_it() {
    for parameters in ["", "gate = 'range'"] {
        walk_up_from_the_side(parameters);
    }
}

fn walk_up_from_the_side(parameters: &str) {
    let mut scene = Scene::new(parameters);
    (scene.measured, scene.wished) = (Twist::planar(0.4, 0.0), Some(Twist::planar(0.4, 0.0)));
    let kind_at = |scene: &mut Scene, from_m: f64| {
        let mut last = Proposal::default();
        for i in 0..6 {
            last = scene.scan([Some(from_m - 0.05 * f64::from(i)), None, None]);
        }
        last
    };
    let limit = kind_at(&mut scene, 2.6);
    assert_eq!((limit.kind(), limit.limits.linear), (Some(Kind::Limit), 0.2));
    assert_eq!(limit.axes, Axes::LINEAR.union(Axes::LATERAL));
    let halt = kind_at(&mut scene, 1.35);
    assert_eq!(halt.kind(), Some(Kind::Halt));
    assert!(halt.note.as_str().starts_with("closing at 1.0 m/s, 1.1 s to contact"), "{}", halt.note.as_str());
    for _ in 0..10 {
        scene.scan([Some(1.0), None, None]);
    }
    assert_eq!(scene.scan([Some(1.0), None, None]).kind(), Some(Kind::Abstain), "who stands beside the path");
}

#[test]
fn losing_odometry_releases_nothing_that_approaches() {
    for (from_m, kind) in [(2.6, Kind::Limit), (1.35, Kind::Halt)] {
        let mut scene = Scene::new("");
        (scene.measured, scene.wished) = (Twist::planar(0.4, 0.0), Some(Twist::planar(0.4, 0.0)));
        for i in 0..6 {
            scene.scan([Some(from_m - 0.05 * f64::from(i)), None, None]);
        }
        assert_eq!(scene.move_on().kind(), Some(kind));
        scene.measured = Twist::planar(f64::NAN, 0.0);
        for _ in 0..20 {
            assert_eq!(scene.scan([Some(0.95), None, None]).kind(), Some(kind), "the motion is not known");
        }
        scene.measured = Twist::planar(0.4, 0.0);
        for _ in 0..7 {
            assert_eq!(scene.scan([Some(0.95), None, None]).kind(), Some(kind), "too few scans");
        }
        scene.scan([Some(0.95), None, None]);
        assert_eq!(scene.move_on().kind(), Some(Kind::Abstain));
    }
}

#[test]
fn the_gate_without_odometry_is_as_long_as_stopping_from_full_speed() {
    let mut scene = Scene::new("gate_m = 0.3");
    scene.measured = Twist::planar(f64::NAN, 0.0);
    assert_eq!(scene.scan([Some(0.46), None, None]).kind(), Some(Kind::Abstain));
    assert_eq!(scene.scan([Some(0.44), None, None]).kind(), Some(Kind::Halt), "0.45 m at 0.6 m/s");
    let mut scene = Scene::new("gate = 'range'\ngate_m = 0.3");
    assert_eq!(scene.scan([Some(0.31), None, None]).kind(), Some(Kind::Abstain), "as configured");
}

#[test]
fn the_weakest_brake_of_a_translation_counts() {
    for (axes, kind) in [(Axes::ALL, Kind::Halt), (Axes::PLANAR, Kind::Abstain)] {
        let mut robot = Robot { axes, ..Robot::default() };
        robot.limits.emergency[Axis::Lateral as usize] = 0.2;
        let mut scene = Scene::with("", robot);
        scene.wished = Some(Twist::planar(0.4, 0.0));
        assert_eq!(scene.scan([None, Some(0.5), None]).kind(), Some(kind), "0.56 m at 0.2 m/s^2");
    }
}
