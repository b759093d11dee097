//! Missing, stale and broken inputs.

use crate::rig::{camera, drive, setup};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Encoding, FrameHeader, Kind, Reason};
use yamabico_core::sensor::SensorKind;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_intersection_tracker::{CAMERA, IntersectionTracker, ODOMETRY};
use yamabico_rigs::approach::{END_M, Ending, world};
use yamabico_rigs::camera::{frame_header, odometry};

const FOV_DEG: f64 = 60.0;

fn pixels() -> Vec<u8> {
    let start = Pose2::new(END_M - 6.0, 0.0, 0.0);
    drive(&world(Ending::Crossing, 2.4), start, camera(640, 480, FOV_DEG), 2.0, 1).render()
}

/// A behavior that drives by a robot that stands, its time, and what it sees.
struct Standing {
    bench: Bench<IntersectionTracker>,
    seconds: f64,
    pixels: Vec<u8>,
}

impl Standing {
    fn new() -> Self {
        let bench = Bench::new("speed_mps = 0.4", setup(camera(640, 480, FOV_DEG))).unwrap();
        let mut standing = Self { bench, seconds: 1.0, pixels: pixels() };
        for _ in 0..5 {
            let seen = standing.pixels.clone();
            standing.see(&seen, Pose2::IDENTITY);
        }
        assert_eq!(standing.see(&standing.pixels.clone(), Pose2::IDENTITY), (Kind::Drive, Reason::Nominal));
        standing
    }

    /// Returns the proposal on these pixels, 0.1 s later, with this odometry pose.
    fn see(&mut self, pixels: &[u8], wheels: Pose2) -> (Kind, Reason) {
        self.seconds += 0.1;
        let header = frame_header(&camera(640, 480, FOV_DEG).0, self.seconds);
        self.bench.at(self.seconds).feed(&ODOMETRY, &odometry(self.seconds, wheels, Twist::ZERO), &[]);
        self.bench.feed(&CAMERA, &header, pixels);
        self.propose()
    }

    fn propose(&mut self) -> (Kind, Reason) {
        let proposal = self.bench.propose();
        assert!(proposal.twist.is_finite());
        (proposal.kind().unwrap(), proposal.reason().unwrap())
    }
}

#[test]
fn missing_and_stale_inputs_are_named() {
    let mut bench = Bench::<IntersectionTracker>::new("", setup(camera(640, 480, FOV_DEG))).unwrap();
    assert_eq!(bench.propose().reason(), Some(Reason::NoInput));
    let mut standing = Standing::new();
    standing.bench.at(standing.seconds + 0.4);
    assert_eq!(standing.propose(), (Kind::Abstain, Reason::StaleInput), "no image for 0.4 s");
}

#[test]
fn pictures_that_show_nothing_are_coasted_through_and_then_lost() {
    let blank = |level: u8| vec![level; 640 * 480];
    let blurred = |pixels: &[u8]| {
        let row = |v: usize| &pixels[640 * v..640 * (v + 1)];
        let mean = |v: usize| {
            (0..640).map(move |u: usize| {
                let window = &row(v)[u.saturating_sub(40)..(u + 41).min(640)];
                (window.iter().map(|&x| u32::from(x)).sum::<u32>() / window.len() as u32) as u8
            })
        };
        (0..480).flat_map(mean).collect::<Vec<u8>>()
    };
    let sharp = pixels();
    for (what, image) in [("dark", blank(0)), ("saturated", blank(255)), ("blurred", blurred(&sharp))] {
        let mut standing = Standing::new();
        let said: Vec<_> = (0..14).map(|_| standing.see(&image, Pose2::IDENTITY)).collect();
        assert_eq!(said[0], (Kind::Drive, Reason::Coasting), "{what}");
        assert_eq!(said[13], (Kind::Abstain, Reason::IntersectionLost), "{what}");
        assert!(said.iter().all(|(_, reason)| *reason != Reason::Nominal), "{what}: {said:?}");
    }
}

#[test]
fn frames_of_another_size_or_encoding_are_malformed() {
    let intrinsics = camera(640, 480, FOV_DEG).0;
    let header = frame_header(&intrinsics, 1.0);
    for wrong in [
        FrameHeader { width: 320, ..header },
        FrameHeader { stride: 100, ..header },
        FrameHeader { encoding: 99, ..header },
        FrameHeader { encoding: Encoding::Rgb8.code(), ..header },
    ] {
        let mut bench = Bench::<IntersectionTracker>::new("", setup(camera(640, 480, FOV_DEG))).unwrap();
        let proposal = bench.at(1.0).feed(&CAMERA, &wrong, &pixels()).propose();
        assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::MalformedInput)));
    }
}

#[test]
fn a_jump_of_the_odometry_drops_what_refers_to_it() {
    let mut standing = Standing::new();
    let seen = standing.pixels.clone();
    let jumped = Pose2::new(5.0, 2.0, 1.0);
    let (kind, _) = standing.see(&seen, jumped);
    assert_eq!(kind, Kind::Abstain);
    let said: Vec<_> = (0..4).map(|_| standing.see(&seen, jumped)).collect();
    assert_eq!(said[3], (Kind::Drive, Reason::Nominal), "found again: {said:?}");
}

#[test]
fn odometry_that_is_no_number_is_none() {
    let mut standing = Standing::new();
    let seen = standing.pixels.clone();
    let broken = Pose2 { x: f64::NAN, y: 0.0, theta: 0.0 };
    let said: Vec<_> = (0..5).map(|_| standing.see(&seen, broken)).collect();
    assert_eq!(said[4], (Kind::Abstain, Reason::StaleInput), "{said:?}");
}

#[test]
fn pictures_from_the_past_and_the_future_are_left_out() {
    for offset_s in [-0.5, 0.0, 0.5] {
        let mut standing = Standing::new();
        let header = frame_header(&camera(640, 480, FOV_DEG).0, standing.seconds + offset_s);
        standing.bench.at(standing.seconds).feed(&CAMERA, &header, &vec![0; 640 * 480]);
        let (kind, _) = standing.propose();
        assert_eq!(kind, Kind::Drive, "{offset_s} s: the last image still counts");
        let evidence = standing.bench.propose().evidence_ns;
        assert_eq!(evidence, Time::from_secs_f64(standing.seconds).0, "{offset_s} s");
    }
}

#[test]
fn a_camera_without_calibration_is_refused() {
    let mut setup = setup(camera(640, 480, FOV_DEG));
    if let SensorKind::Camera { calibrated, .. } = &mut setup.sensors[0].1.kind {
        *calibrated = Calibration::Guessed;
    }
    let refused = Bench::<IntersectionTracker>::new("", setup).err().unwrap();
    assert_eq!(refused.key, "inputs.camera");
}

#[test]
fn keys_out_of_range_are_refused() {
    for (text, key) in [
        ("handover_m = 0.1", "handover_m"),
        ("handover_m = 4\nmax_range_m = 3", "max_range_m"),
        ("reacquire_misses = 9\nlost_misses = 5", "lost_misses"),
        ("min_correlation = nan", "min_correlation"),
    ] {
        let refused =
            Bench::<IntersectionTracker>::new(text, setup(camera(640, 480, FOV_DEG))).err().unwrap();
        assert_eq!(refused.key, key, "{text}");
    }
}
