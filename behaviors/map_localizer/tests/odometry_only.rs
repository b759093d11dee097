//! A robot by its odometry alone: when it drives, looks around, holds its goal or leaves the robot to others.

use crate::rig::frame_header;
use yamabico_core::behavior::{Behavior, Setup};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Goal, Kind, Odometry, PathHeader, Pose, PoseStatus, Proposal, Reason};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, GOAL, MapLocalizer, ODOMETRY};

/// Parameter of a start so uncertain that the pose is lost.
const UNCERTAIN: &str = "start = { sigma_m = 1.0 }";
const ROUTE: &str = "route = [[1.0, 0.0]]";

fn bench(parameters: &[&str]) -> Bench<MapLocalizer> {
    let parameters = format!("method = \"dead-reckoning\"\n{}", parameters.join("\n"));
    Bench::new(&parameters, Setup::default()).unwrap()
}

/// Feeds odometry and returns the proposal.
fn at(bench: &mut Bench<MapLocalizer>, seconds: f64, odometry: Pose2) -> Proposal {
    let Pose2 { x, y, theta } = odometry;
    let stamp_ns = Time::from_secs_f64(seconds).0;
    bench.at(seconds).feed(&ODOMETRY, &Odometry { stamp_ns, x, y, theta, ..Odometry::default() }, &[]);
    bench.propose()
}

/// Returns a robot at rest whose pose is lost, at 1.1 s, and its proposal.
fn lost(parameters: &[&str]) -> (Bench<MapLocalizer>, Proposal) {
    let mut bench = bench(&[&[UNCERTAIN], parameters].concat());
    at(&mut bench, 1.0, Pose2::IDENTITY);
    let proposal = at(&mut bench, 1.1, Pose2::IDENTITY);
    assert_eq!(bench.behavior.status().0, PoseStatus::Lost);
    (bench, proposal)
}

fn goal(x: f64, y: f64) -> Goal {
    Goal { x, y, theta: f64::NAN, tolerance_m: 0.1, ..Goal::default() }
}

/// Returns the first and the last corner of the path published by the last call.
fn ends(bench: &Bench<MapLocalizer>) -> Option<[(f64, f64); 2]> {
    let (_, points) = bench.published::<PathHeader>("path").pop()?;
    Some([points.first()?, points.last()?].map(|point| (point.x, point.y)))
}

#[test]
fn a_lost_robot_is_still_lost_after_a_restart() {
    let (lost, _) = lost(&[ROUTE]);
    let mut state = Vec::new();
    lost.behavior.save_state(&mut state);
    let mut restarted = bench(&[ROUTE]);
    restarted.behavior.restore_state(&state);
    for seconds in [1.2, 1.3] {
        let proposal = at(&mut restarted, seconds, Pose2::IDENTITY);
        assert_eq!(restarted.behavior.status().0, PoseStatus::Lost);
        assert_eq!((proposal.reason(), proposal.twist.linear), (Some(Reason::Searching), 0.0));
    }
}

#[test]
fn a_lost_robot_looks_around_only_on_its_way_to_a_goal() {
    let (_, proposal) = lost(&[ROUTE]);
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Drive), Some(Reason::Searching)));
    let (_, proposal) = lost(&[]);
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::Lost)));
}

#[test]
fn a_robot_that_is_lost_at_its_goal_abstains() {
    let mut bench = bench(&[ROUTE]);
    at(&mut bench, 1.0, Pose2::IDENTITY);
    for tick in 1..=100 {
        at(&mut bench, 1.0 + 0.02 * f64::from(tick), Pose2::new(0.01 * f64::from(tick), 0.0, 0.0));
    }
    let proposal = at(&mut bench, 3.1, Pose2::new(1.0, 0.0, 0.0));
    assert_eq!(proposal.note.as_str(), "arrived");
    // Jumps of the odometry make the pose uncertain.
    let mut proposal = proposal;
    for tick in 0..10 {
        proposal =
            at(&mut bench, 3.2 + 0.1 * f64::from(tick), Pose2::new(40.0 * f64::from(tick % 2), 0.0, 0.0));
    }
    assert_eq!(bench.behavior.status().0, PoseStatus::Lost);
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::Lost)));
}

#[test]
fn a_configured_tolerance_can_be_retuned_and_a_stated_one_stays() {
    let note = |is_stated: bool| {
        let mut before = bench(&[ROUTE, "tolerance_m = 0.05"]);
        at(&mut before, 1.0, Pose2::IDENTITY);
        if is_stated {
            before.feed(&GOAL, &goal(1.0, 0.0), &[]);
        }
        at(&mut before, 1.1, Pose2::IDENTITY);
        let mut state = Vec::new();
        before.behavior.save_state(&mut state);
        let mut after = bench(&[ROUTE, "tolerance_m = 0.5"]);
        after.behavior.restore_state(&state);
        let mut proposal = Proposal::default();
        for tick in 1..=70 {
            let odometry = Pose2::new(0.01 * f64::from(tick), 0.0, 0.0);
            proposal = at(&mut after, 1.1 + 0.02 * f64::from(tick), odometry);
        }
        proposal.note.as_str().to_owned()
    };
    assert_eq!(note(false), "arrived", "0.3 m from the goal");
    assert!(note(true).contains("to go"), "{}", note(true));
}

#[test]
fn a_goal_waits_for_odometry() {
    let mut bench = bench(&[]);
    bench.at(0.9).feed(&GOAL, &goal(2.0, 1.0), &[]);
    assert_eq!(bench.propose().reason(), Some(Reason::NoInput));
    let proposal = at(&mut bench, 1.0, Pose2::IDENTITY);
    assert_eq!((proposal.kind(), ends(&bench)), (Some(Kind::Drive), Some([(0.0, 0.0), (2.0, 1.0)])));
}

#[test]
fn a_lost_robot_keeps_a_goal_until_it_is_found() {
    let (mut bench, _) = lost(&[]);
    bench.feed(&GOAL, &goal(2.0, 1.0), &[]);
    let proposal = at(&mut bench, 1.2, Pose2::IDENTITY);
    assert_eq!((proposal.reason(), ends(&bench)), (Some(Reason::Searching), None));
}

#[test]
fn a_lost_robot_turns_no_faster_than_configured() {
    let (mut bench, _) = lost(&[ROUTE, "max_turn_radps = 0.2"]);
    let proposal = at(&mut bench, 1.6, Pose2::new(0.0, 0.0, 0.5));
    assert_eq!((proposal.reason(), proposal.twist.angular), (Some(Reason::Searching), -0.2));
}

#[test]
fn a_jump_of_the_odometry_is_no_change_of_speed() {
    let no_drift = "odometry = { drift_deg_per_m = 0, k_ts = 0, k_tt = 0 }";
    let mut bench = bench(&["start = { sigma_deg = 0.1 }", no_drift, "route = [[20.0, 0.0]]"]);
    let (mut x, mut speed, mut variances) = (0.0, 0.0_f64, Vec::new());
    for tick in 0..350 {
        speed = (speed + 0.25 * 0.02).min(1.0);
        x += 0.02 * speed;
        let jump_m = if tick < 300 { 0.0 } else { 40.0 };
        at(&mut bench, 1.0 + 0.02 * f64::from(tick), Pose2::new(x + jump_m, 0.0, 0.0));
        variances.push(bench.published::<Pose>("pose")[0].0.covariance[8]);
    }
    // The jump adds 0.1 rad, and the steady motion nothing.
    assert!((variances[299]..variances[299] + 0.011).contains(&variances[349]), "{:?}", &variances[298..]);
}

#[test]
fn an_image_of_a_search_counts_at_the_heading_of_its_capture() {
    // The lens cap is on: in no image is the pose found.
    let turn_after_images = |latency_s: f64| {
        let (mut bench, _) = lost(&[ROUTE]);
        let black = [0; 8 * 8];
        for i in 0..3 {
            bench.feed(&CAMERA, &frame_header(8, 8, 1.11 + 0.01 * f64::from(i)), &black);
            at(&mut bench, 1.2 + 0.02 * f64::from(i), Pose2::IDENTITY);
        }
        // The search goes on to 0.7 rad, which is reached at 2.6 s.
        for tick in 1..=100 {
            let seconds = 1.3 + 0.02 * f64::from(tick);
            at(&mut bench, seconds, Pose2::new(0.0, 0.0, 0.7 * (seconds - 1.3).min(1.3) / 1.3));
        }
        for i in 0..3 {
            let now_s = 3.32 + 0.02 * f64::from(i);
            bench.feed(&CAMERA, &frame_header(8, 8, now_s - latency_s), &black);
            at(&mut bench, now_s, Pose2::new(0.0, 0.0, 0.7));
        }
        at(&mut bench, 3.4, Pose2::new(0.0, 0.0, 0.7)).twist.angular
    };
    assert!(turn_after_images(0.1) < -0.1, "on to the next heading");
    assert_eq!(turn_after_images(1.5), 0.0, "captured on the way to this one");
}

#[test]
fn the_turn_to_the_heading_of_the_goal_is_uncoupled() {
    let mut bench = bench(&[]);
    let goal = Goal { theta: 1.0, ..goal(0.05, 0.0) };
    at(&mut bench, 1.0, Pose2::IDENTITY);
    bench.feed(&GOAL, &goal, &[]);
    let turning = at(&mut bench, 1.1, Pose2::IDENTITY);
    assert!(turning.twist.angular > 0.0 && turning.coupled == 0, "{turning:?}");
}
