//! Approaches to rendered intersections.

use crate::rig::{Drive, camera, drive, true_column};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Intersection, Kind, Reason};
use yamabico_intersection_tracker::finder::Side;
use yamabico_rigs::approach::{END_M, Ending, world};

/// A robot so far before the end of the walls, beside the middle and turned.
fn before(ending: Ending, ahead_m: f64) -> Drive {
    let start = Pose2::new(END_M - ahead_m, 0.15, -0.05);
    drive(&world(ending, 2.4), start, camera(640, 480, 60.0), 4.0, 5)
}

fn is_driving(drive: &Drive) -> bool {
    drive.proposal.kind() == Some(Kind::Drive)
}

#[test]
fn comes_to_a_crossing_and_to_a_tee_and_hands_over() {
    for ending in [Ending::Crossing, Ending::Tee] {
        let mut drive = before(ending, 10.0);
        let (mut worst_px, mut worst_near_px, mut images) = (0.0_f64, 0.0_f64, 0);
        loop {
            let has_picture = drive.step();
            let ahead_m = END_M - drive.robot.x;
            assert!(drive.now_s() < 40.0, "stands at {:?} with {:?}", drive.robot, drive.proposal.reason());
            if drive.now_s() > 1.0 && !is_driving(&drive) {
                break;
            }
            if !has_picture || !is_driving(&drive) {
                continue;
            }
            let published = drive.bench.published::<Intersection>("intersection");
            let (message, _) = &published[0];
            assert!((message.distance_m - ahead_m).abs() < 0.05 * ahead_m + 0.02, "{message:?} at {ahead_m}");
            assert!((message.distance_m - ahead_m).abs() < 4.0 * message.sigma_m, "{message:?} at {ahead_m}");
            let track = drive.bench.behavior.track();
            let error = |side| Some(track.observed_at(side)?.x - true_column(&drive, side)?);
            let Some((left, right)) = error(Side::Left).zip(error(Side::Right)) else { continue };
            let middle_px = 0.5 * (left + right).abs();
            worst_px = worst_px.max(middle_px);
            if ahead_m < 4.0 {
                worst_near_px = worst_near_px.max(middle_px);
            }
            images += 1;
        }
        assert_eq!(drive.proposal.reason(), Some(Reason::Nominal), "{ending:?}: handed over");
        assert!(END_M - drive.robot.x < 2.3, "{ending:?}: handed over at {}", drive.robot.x);
        assert!(drive.robot.y.abs() < 0.06, "{ending:?}: {} m beside the middle", drive.robot.y);
        assert!(images > 180, "{ending:?}: {images} images");
        assert!(
            worst_px <= 2.0 && worst_near_px <= 1.0,
            "{ending:?}: {worst_px} px, {worst_near_px} px near"
        );
    }
}

#[test]
fn a_dead_end_is_none() {
    let mut drive = before(Ending::DeadEnd, 9.0);
    while END_M - drive.robot.x > 1.5 {
        drive.step();
        assert!(!is_driving(&drive), "drives at {:?}", drive.robot);
    }
}

#[test]
fn one_edge_slows_then_is_told_but_not_followed() {
    let mut drive = before(Ending::Crossing, 8.0);
    while drive.now_s() < 4.0 {
        drive.step();
    }
    assert!(is_driving(&drive) && drive.proposal.twist.linear > 0.35, "{:?}", drive.proposal.reason());
    drive.covered_from = 330;
    let mut slowest_mps = f64::INFINITY;
    while drive.now_s() < 6.0 {
        drive.step();
        assert!(drive.proposal.twist.linear <= 0.4, "never faster");
        if is_driving(&drive) {
            slowest_mps = slowest_mps.min(drive.proposal.twist.linear);
        }
    }
    assert!((slowest_mps - 0.2).abs() < 0.02, "half the speed: {slowest_mps}");
    assert_eq!((drive.proposal.reason(), is_driving(&drive)), (Some(Reason::OneSided), false));
    assert_eq!(drive.bench.published::<Intersection>("intersection").len(), 1, "still published");
    drive.covered_from = usize::MAX;
    while drive.now_s() < 8.0 {
        drive.step();
    }
    assert_eq!((drive.proposal.reason(), is_driving(&drive)), (Some(Reason::Nominal), true), "found again");
}

#[test]
fn in_the_dark_it_coasts_then_is_lost_then_finds_again() {
    let mut drive = before(Ending::Crossing, 8.0);
    while drive.now_s() < 3.0 {
        drive.step();
    }
    drive.gain = 0.0;
    let mut reasons = Vec::new();
    while drive.now_s() < 5.5 {
        drive.step();
        let reason = drive.proposal.reason();
        if reasons.last() != Some(&reason) {
            reasons.push(reason);
        }
        let dark_s = drive.now_s() - 3.0;
        if dark_s > 0.3 && is_driving(&drive) {
            assert!(drive.proposal.twist.linear <= 0.2 + 1e-9, "{dark_s} s: {:?}", drive.proposal.twist);
        }
        assert!(dark_s < 1.4 || !is_driving(&drive), "still drives after {dark_s} s in the dark");
    }
    let [nominal, coasting, lost] = [Reason::Nominal, Reason::Coasting, Reason::IntersectionLost].map(Some);
    assert_eq!(reasons, [nominal, coasting, lost]);
    drive.gain = 1.0;
    drive.fallback.linear = 0.0;
    while drive.now_s() < 8.0 {
        drive.step();
    }
    assert!(is_driving(&drive), "light again: {:?}", drive.proposal.reason());
}

#[test]
fn drives_by_pictures_alone() {
    let mut drive = before(Ending::Tee, 6.0);
    drive.has_odometry = false;
    let mut driven = 0;
    while END_M - drive.robot.x > 3.0 {
        drive.step();
        driven += u32::from(is_driving(&drive));
        assert!(drive.now_s() < 30.0, "stands at {:?} with {:?}", drive.robot, drive.proposal.reason());
    }
    assert!(driven > 200, "drove {driven} ticks");
    assert!(drive.robot.y.abs() < 0.15, "{} m beside the middle", drive.robot.y);
}
