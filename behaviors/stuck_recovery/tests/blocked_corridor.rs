//! Closed loop with the arbiter and sonar-halt: a robot that wrongly believes the way ahead to be free gets past the end of a wall, and
//! one that touches it gets away.

use yamabico_arbiter::decide::{ArbiterState, Decision, DecisionMessage, decide};
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, Policy};
use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, Beam, Kind, NO_ECHO, Name, Odometry, Outcome, Proposal, RangeScanHeader, Reason, Twist,
};
use yamabico_core::sensor::{MotionLimits, Robot};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_sonar_halt as sonar_halt;
use yamabico_sonar_halt::SonarHalt;
use yamabico_stuck_recovery::StuckRecovery;

const TICK_NS: u64 = 20_000_000;
const RADIUS_M: f64 = 0.2;
const MAX_RANGE_M: f64 = 3.0;

/// A corridor 2.4 m wide with a wall across at x = 2 m that leaves a gap on the left.
fn hits(x: f64, y: f64) -> bool {
    y.abs() > 1.2 || ((2.0..2.1).contains(&x) && y < 0.3)
}

fn is_touching(pose: &Pose2) -> bool {
    (0..36).any(|i| {
        let angle = f64::from(i) * 10_f64.to_radians();
        hits(pose.x + RADIUS_M * angle.cos(), pose.y + RADIUS_M * angle.sin())
    })
}

/// Range from the rim, the nearest within a cone of 22 degrees.
fn beam(pose: &Pose2, degrees: f64) -> Beam {
    let azimuth_rad = degrees.to_radians();
    let (x_m, y_m) = (RADIUS_M * azimuth_rad.cos(), RADIUS_M * azimuth_rad.sin());
    let sensor = *pose * Pose2::new(x_m, y_m, 0.0);
    let ray = |offset_deg: f64| {
        let angle = pose.theta + azimuth_rad + offset_deg.to_radians();
        let reach = (0..300).map(|i| 0.01 * f64::from(i));
        reach.into_iter().find(|r| hits(sensor.x + r * angle.cos(), sensor.y + r * angle.sin()))
    };
    let range = (-5..=5).filter_map(|i| ray(2.2 * f64::from(i))).fold(MAX_RANGE_M, f64::min);
    let flags = if range < MAX_RANGE_M { 0 } else { NO_ECHO };
    Beam { azimuth_rad, cone_rad: 22_f64.to_radians(), range_m: range, x_m, y_m, flags, ..Beam::default() }
}

/// Drives ahead at 0.4 m/s along its present heading, and back towards the corridor's axis after a while.
fn driver(pose: &Pose2) -> Proposal {
    let turn = (-0.4 * pose.theta).clamp(-0.3, 0.3);
    Proposal::drive(Axes::PLANAR, Twist::planar(0.4, turn))
}

/// Waits for a way to become free.
fn waits(_: &Pose2) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::ZERO).with_reason(Reason::PassageBlocked)
}

struct Outcomes {
    pose: Pose2,
    halted_s: f64,
    tried: Vec<String>,
}

/// Runs for this time after the robot was pushed ahead by `pushed_m` along the axis, within a second.
fn run(seconds: f64, recovers: bool, driver: fn(&Pose2) -> Proposal, pushed_m: f64) -> Outcomes {
    let limits = MotionLimits::default();
    let names = ["sonar-halt", "stuck-recovery", "driver"];
    let behaviors =
        names.iter().zip([100, 60, 10]).map(|(name, priority)| BehaviorPolicy::new(name, priority));
    let policy = Policy::new(limits, Kinematics::Body { axes: Axes::PLANAR }, behaviors.collect());
    let (mut state, mut decision) = (ArbiterState::new(&policy), Decision::new(&policy));
    let robot = Robot { radius_m: RADIUS_M, ..Robot::default() };
    let setup = |name: &str| Setup { name: name.into(), robot: robot.clone(), ..Setup::default() };
    let mut halt = Bench::<SonarHalt>::new("", setup("sonar-halt")).unwrap();
    let mut recovery =
        Bench::<StuckRecovery>::new("progress_timeout_s = 4.0", setup("stuck-recovery")).unwrap();
    let mut pose = Pose2::default();
    let mut twist = Twist::ZERO;
    let mut outcomes = Outcomes { pose, halted_s: 0.0, tried: Vec::new() };
    let mut proposals = [None; 3];
    for tick in 1..(seconds * 50.0) as u64 {
        let now = Time(tick * TICK_NS);
        let odometry = Odometry::new(now.0, &pose, &twist);
        halt.at(now.as_secs_f64()).feed(&sonar_halt::ODOMETRY, &odometry, &[]);
        recovery.at(now.as_secs_f64()).feed(&yamabico_stuck_recovery::ODOMETRY, &odometry, &[]);
        if tick % 3 == 0 {
            let header = RangeScanHeader { stamp_ns: now.0, ..RangeScanHeader::default() };
            let beams = [35.0, 0.0, -35.0].map(|degrees| beam(&pose, degrees));
            halt.feed(&sonar_halt::SONAR, &header, &beams);
            recovery.feed(&yamabico_stuck_recovery::SONAR, &header, &beams);
        }
        let stamped = |proposal: Proposal, name: &str| {
            let stamps = Proposal { behavior: Name::new(name), sequence: tick, stamp_ns: now.0, ..proposal };
            Some(Proposal { evidence_ns: now.0, received_ns: now.0, proposed_ns: now.0, ..stamps })
        };
        proposals[0] = stamped(halt.propose(), names[0]);
        if recovers {
            proposals[1] = stamped(recovery.propose(), names[1]);
        }
        proposals[2] = stamped(driver(&pose), names[2]);
        decide(&policy, &mut state, &proposals, now, &mut decision);
        let message = DecisionMessage::new(&policy, &decision);
        halt.feed(&sonar_halt::DECISION, &message.header, &message.verdicts);
        recovery.feed(&yamabico_stuck_recovery::DECISION, &message.header, &message.verdicts);

        let proposed = proposals[1].filter(|proposal| proposal.kind() == Some(Kind::Drive));
        if let Some(proposal) = proposed {
            let rung = proposal.note.as_str().split(',').nth(1).unwrap_or_default().trim().to_owned();
            if outcomes.tried.last() != Some(&rung) {
                outcomes.tried.push(rung);
            }
            let verdict = message.verdict("stuck-recovery").unwrap();
            let halts = message.header.halted;
            assert!(
                halts.is_empty()
                    || verdict.outcome() != Some(Outcome::Won)
                    || message.header.commanded.linear <= 0.0
            );
        }
        outcomes.halted_s += f64::from(u8::from(!message.header.halted.is_empty())) * 0.02;
        twist = decision.commanded;
        if tick < 50 && pushed_m > 0.0 {
            pose.x = pushed_m * tick as f64 / 49.0;
        } else {
            pose = pose.integrate(&twist, 0.02);
        }
        assert!(!is_touching(&pose), "touches something at {pose:?}, {} s", now.as_secs_f64());
    }
    Outcomes { pose, ..outcomes }
}

#[test]
fn without_recovery_it_stands_before_the_wall() {
    let ended = run(120.0, false, driver, 0.0);
    assert!(ended.pose.x < 1.9 && ended.halted_s > 90.0, "{:?} {}", ended.pose, ended.halted_s);
}

#[test]
fn with_recovery_it_gets_past_the_wall() {
    let ended = run(240.0, true, driver, 0.0);
    assert!(ended.pose.x > 2.5, "{:?} after {:?}", ended.pose, ended.tried);
    assert!(ended.tried.len() > 2, "{:?}", ended.tried);
}

#[test]
fn a_robot_that_touches_the_wall_backs_off_although_every_axis_is_halted() {
    let pushed_m = 1.78;
    let stays = run(60.0, false, waits, pushed_m);
    assert!((stays.pose.x - pushed_m).abs() < 0.01 && stays.halted_s > 58.0, "{}", stays.halted_s);
    let leaves = run(8.0, true, waits, pushed_m);
    assert_eq!(leaves.tried, ["back-off"]);
    assert!((1.2..1.5).contains(&leaves.pose.x), "{:?}", leaves.pose);
}
