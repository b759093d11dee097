//! Missing, stale and broken inputs.

use crate::rig::{camera, render, setup};
use yamabico_core::behavior::Setup;
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Corridor, Encoding, FrameHeader, Kind, Odometry, Reason};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_rigs::camera::frame_header;
use yamabico_wall_follower::{CAMERA, CORRIDOR, ODOMETRY, WallFollower};

const METHODS: [&str; 2] = ["evidence", "presumed-horizon"];

fn bench_by(method: &str, calibration: Calibration) -> Bench<WallFollower> {
    let (intrinsics, mount) = camera(256, 240);
    let toml = format!("speed_mps = 0.4\nmethod = \"{method}\"");
    Bench::new(&toml, setup(intrinsics, mount, calibration)).expect("a valid configuration")
}

/// Returns the behavior by the method that believes a single image.
fn bench(calibration: Calibration) -> Bench<WallFollower> {
    bench_by("presumed-horizon", calibration)
}

/// Shows the same image for half a second before 1 s, since evidence for a corridor takes some images.
fn establish(bench: &mut Bench<WallFollower>, pixels: &[u8], has_odometry: bool) {
    let (intrinsics, _) = camera(256, 240);
    for i in 5..10 {
        let seconds = 0.1 * f64::from(i);
        bench.at(seconds).feed(&CAMERA, &frame_header(&intrinsics, seconds), pixels);
        if has_odometry {
            bench.feed(&ODOMETRY, &odometry(seconds), &[]);
        }
        bench.propose();
    }
}

fn odometry(seconds: f64) -> Odometry {
    Odometry { stamp_ns: Time::from_secs_f64(seconds).0, ..Odometry::default() }
}

#[test]
fn turns_right_when_it_points_left() {
    let (intrinsics, mount) = camera(256, 240);
    // The evidence method does not establish the bare rendered corridor from another heading than its own.
    for (method, pose, calibration, reason) in [
        ("presumed-horizon", Pose2::new(0.0, 0.0, 0.1), Calibration::Measured, Reason::Nominal),
        ("presumed-horizon", Pose2::new(0.0, 0.3, 0.0), Calibration::Measured, Reason::Nominal),
        ("presumed-horizon", Pose2::new(0.0, 0.0, 0.1), Calibration::Guessed, Reason::NoHeightCalibration),
        ("evidence", Pose2::new(0.0, 0.3, 0.0), Calibration::Measured, Reason::Nominal),
    ] {
        let pixels = render(intrinsics, mount, pose);
        let mut bench = bench_by(method, calibration);
        establish(&mut bench, &pixels, true);
        bench.at(1.05).feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels);
        let proposal = bench.feed(&ODOMETRY, &odometry(1.04), &[]).propose();
        assert_eq!(
            (proposal.kind(), proposal.reason()),
            (Some(Kind::Drive), Some(reason)),
            "{method}, {pose:?}"
        );
        assert!(proposal.twist.angular < -0.02 && proposal.twist.linear > 0.1, "{:?}", proposal.twist);
        assert_eq!(proposal.evidence_ns, Time::from_secs_f64(1.0).0);
        assert_eq!(proposal.stamp_ns, Time::from_secs_f64(1.04).0);
    }
}

#[test]
fn drives_without_odometry() {
    let (intrinsics, mount) = camera(256, 240);
    for method in METHODS {
        let mut bench = bench_by(method, Calibration::Guessed);
        establish(&mut bench, &render(intrinsics, mount, Pose2::new(0.0, 0.0, 0.1)), false);
        for (i, heading) in [0.1, 0.05, -0.1].into_iter().enumerate() {
            let pixels = render(intrinsics, mount, Pose2::new(0.0, 0.0, heading));
            let seconds = 1.0 + i as f64 * 0.1;
            bench.at(seconds).feed(&CAMERA, &frame_header(&intrinsics, seconds), &pixels);
            let turn = bench.propose().twist.angular;
            assert!(turn * heading < 0.0, "{method}, heading {heading}: turns {turn}");
        }
    }
}

#[test]
fn missing_and_stale_inputs_are_named() {
    let (intrinsics, mount) = camera(256, 240);
    let mut bench = bench(Calibration::Measured);
    assert_eq!(bench.propose().reason(), Some(Reason::NoInput));
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    bench.at(1.0).feed(&ODOMETRY, &odometry(1.0), &[]).feed(
        &CAMERA,
        &frame_header(&intrinsics, 1.0),
        &pixels,
    );
    assert_eq!(bench.propose().kind(), Some(Kind::Drive));
    let silent = bench.at(1.5).propose();
    assert_eq!((silent.kind(), silent.reason()), (Some(Kind::Abstain), Some(Reason::StaleInput)));
}

#[test]
fn a_camera_that_falls_silent_stops_the_robot() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    for method in METHODS {
        let mut bench = bench_by(method, Calibration::Measured);
        establish(&mut bench, &pixels, true);
        bench.at(1.0).feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels);
        for i in 0..40 {
            let seconds = 1.0 + 0.1 * f64::from(i);
            let proposal = bench.at(seconds).feed(&ODOMETRY, &odometry(seconds), &[]).propose();
            let is_driving = proposal.kind() == Some(Kind::Drive) && proposal.twist.linear > 0.0;
            assert_eq!(
                is_driving,
                seconds <= 2.0 + 1e-9,
                "{method}, at {seconds} s: {:?}",
                proposal.reason()
            );
            if !is_driving {
                assert_eq!(proposal.reason(), Some(Reason::StaleInput), "{method}, at {seconds} s");
            }
        }
    }
}

#[test]
fn a_camera_that_falls_silent_slows_the_robot_down() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    let mut bench = bench(Calibration::Measured);
    establish(&mut bench, &pixels, true);
    bench.at(1.0).feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels);
    let mut speed_at =
        |seconds: f64| bench.at(seconds).feed(&ODOMETRY, &odometry(seconds), &[]).propose().twist.linear;
    let full_mps = speed_at(1.1);
    assert_eq!(speed_at(1.4), full_mps);
    assert!((speed_at(1.6) - 0.5 * full_mps).abs() < 0.02, "{full_mps}");
}

#[test]
fn without_coasting_the_robot_drives_while_pictures_come() {
    let (intrinsics, mount) = camera(256, 240);
    let (lit, dark) = (render(intrinsics, mount, Pose2::IDENTITY), vec![0; 256 * 240]);
    let toml = "speed_mps = 0.4\nlost = { coast_s = 0.0, search_deg = 0.0 }";
    let mut bench =
        Bench::<WallFollower>::new(toml, setup(intrinsics, mount, Calibration::Measured)).expect("valid");
    let mut drives = |tick: u32| {
        let seconds = 0.05 * f64::from(tick);
        bench.at(seconds).feed(&ODOMETRY, &odometry(seconds), &[]);
        // A picture in every second call, 40 ms old.
        if tick.is_multiple_of(2) {
            let pixels = if tick < 40 { &lit } else { &dark };
            bench.feed(&CAMERA, &frame_header(&intrinsics, seconds - 0.04), pixels);
        }
        bench.propose().twist.linear > 0.0
    };
    assert!((2..40).all(&mut drives), "pictures show the corridor");
    assert!(!(40..60).any(drives), "they do not");
}

#[test]
fn the_corridor_is_published_at_the_pose_of_its_stamp() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    let mut bench = bench(Calibration::Measured);
    establish(&mut bench, &pixels, true);
    let corridor = |bench: &Bench<WallFollower>| bench.published::<Corridor>(CORRIDOR.name)[0].0;
    let before = corridor(&bench);
    let turning = Odometry { theta: 0.05, omega: 1.0, ..odometry(1.08) };
    bench.at(1.1).feed(&ODOMETRY, &odometry(1.0), &[]).feed(&ODOMETRY, &turning, &[]);
    bench.feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels).propose();
    let after = corridor(&bench);
    assert_eq!(after.stamp_ns, Time::from_secs_f64(1.08).0);
    let turned = after.heading_rad - before.heading_rad;
    assert!((turned - 0.05).abs() < 0.005, "turned by 0.05 rad at the stamp, 0.07 rad in the call: {turned}");
}

#[test]
fn a_search_keeps_to_the_rate_of_turns() {
    let (intrinsics, mount) = camera(256, 240);
    let dark = vec![0; 256 * 240];
    let toml = "max_turn_radps = 0.1";
    let mut bench =
        Bench::<WallFollower>::new(toml, setup(intrinsics, mount, Calibration::Measured)).expect("valid");
    let rates = (10..40).map(|tick| {
        let seconds = 0.1 * f64::from(tick);
        bench.at(seconds).feed(&ODOMETRY, &odometry(seconds), &[]);
        let proposal = bench.feed(&CAMERA, &frame_header(&intrinsics, seconds), &dark).propose();
        assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Drive), Some(Reason::Searching)));
        proposal.twist.angular.abs()
    });
    assert_eq!(rates.fold(0.0, f64::max), 0.1);
}

#[test]
fn a_robot_that_creeps_on_stops_when_the_camera_falls_silent() {
    let (intrinsics, mount) = camera(256, 240);
    let (lit, dark) = (render(intrinsics, mount, Pose2::IDENTITY), vec![0; 256 * 240]);
    let toml = "speed_mps = 0.4\nlost = { creep_m = 2.0 }";
    let mut bench =
        Bench::<WallFollower>::new(toml, setup(intrinsics, mount, Calibration::Measured)).expect("valid");
    let mut step = |tick: u32, pixels: Option<&[u8]>| {
        let seconds = 0.1 * f64::from(tick);
        bench.at(seconds);
        bench.feed(&ODOMETRY, &Odometry { x: 0.4 * seconds, ..odometry(seconds) }, &[]);
        if let Some(pixels) = pixels {
            bench.feed(&CAMERA, &frame_header(&intrinsics, seconds), pixels);
        }
        let proposal = bench.propose();
        (proposal.kind() == Some(Kind::Drive) && proposal.twist.linear > 0.0, proposal.reason())
    };
    assert!((1..50).all(|tick| step(tick, Some(&lit)).0));
    let in_dark = (50..70).map(|tick| step(tick, Some(&dark))).last();
    assert_eq!(in_dark, Some((true, Some(Reason::Searching))), "creeps on");
    let in_silence = (70..85).map(|tick| step(tick, None)).last();
    assert_eq!(in_silence, Some((false, Some(Reason::StaleInput))));
}

#[test]
fn broken_pictures_are_named() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    let good = frame_header(&intrinsics, 1.0);
    for (header, pixels) in [
        (FrameHeader { width: 200, ..good }, &pixels[..]),
        (FrameHeader { stride: 10, ..good }, &pixels[..]),
        (FrameHeader { encoding: 77, ..good }, &pixels[..]),
        (FrameHeader { encoding: Encoding::Rgb8.code(), ..good }, &pixels[..]),
        (FrameHeader { stamp_ns: u64::MAX, ..good }, &pixels[..]),
        (good, &pixels[..1000]),
        (good, &[]),
    ] {
        let mut bench = bench(Calibration::Measured);
        bench.at(1.0).feed(&ODOMETRY, &odometry(1.0), &[]).feed(&CAMERA, &header, pixels);
        let first = bench.propose();
        assert_eq!(
            (first.kind(), first.reason()),
            (Some(Kind::Abstain), Some(Reason::MalformedInput)),
            "{header:?}"
        );
        // Seconds later it neither drives nor looks around.
        bench.at(4.0).feed(&ODOMETRY, &odometry(4.0), &[]);
        let header = FrameHeader { stamp_ns: header.stamp_ns.saturating_add(3_000_000_000), ..header };
        let later = bench.feed(&CAMERA, &header, pixels).propose();
        assert_eq!(
            (later.kind(), later.reason()),
            (Some(Kind::Abstain), Some(Reason::MalformedInput)),
            "{header:?}"
        );
    }
    let mut bench = bench(Calibration::Measured);
    let nan = Odometry { x: f64::NAN, ..odometry(1.0) };
    bench.at(1.0).feed(&ODOMETRY, &nan, &[]).feed(&CAMERA, &good, &pixels);
    assert!(bench.propose().twist.is_finite());
}

#[test]
fn odometry_from_the_future_is_refused() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    let mut bench = bench(Calibration::Measured);
    bench.at(1.0).feed(&ODOMETRY, &Odometry { stamp_ns: u64::MAX, ..odometry(1.0) }, &[]);
    let proposal =
        bench.feed(&ODOMETRY, &odometry(1.0), &[]).feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels);
    assert_eq!(proposal.propose().stamp_ns, Time::from_secs_f64(1.0).0);
}

#[test]
fn odometry_that_starts_late_turns_nothing() {
    let (intrinsics, mount) = camera(256, 240);
    let pixels = render(intrinsics, mount, Pose2::IDENTITY);
    let mut bench = bench(Calibration::Measured);
    bench.at(1.0).feed(&CAMERA, &frame_header(&intrinsics, 1.0), &pixels);
    assert_eq!(bench.propose().kind(), Some(Kind::Drive));
    let turned = |seconds: f64| Odometry { theta: 2.0, ..odometry(seconds) };
    let first = bench.at(1.05).feed(&ODOMETRY, &turned(1.05), &[]).propose();
    assert!(first.twist.angular.abs() < 0.05, "{first:?}");
    bench.at(1.1).feed(&ODOMETRY, &turned(1.1), &[]).feed(&CAMERA, &frame_header(&intrinsics, 1.1), &pixels);
    let second = bench.propose();
    assert_eq!((second.kind(), second.reason()), (Some(Kind::Drive), Some(Reason::Nominal)));
    assert!(second.twist.angular.abs() < 0.05, "{:?}", second.twist);
}

#[test]
fn parameters_and_slots_are_checked() {
    let (intrinsics, mount) = camera(256, 240);
    let refused = |toml: &str| {
        let setup = setup(intrinsics, mount, Calibration::Measured);
        Bench::<WallFollower>::new(toml, setup).err().map(|error| error.key)
    };
    assert_eq!(refused("speed_mps = 9.0").as_deref(), Some("speed_mps"));
    assert_eq!(refused("near_wall_m = 0.1\nstop_wall_m = 0.2").as_deref(), Some("stop_wall_m"));
    assert_eq!(refused("lost = { step_deg = 0.0 }").as_deref(), Some("lost.step_deg"));
    assert!(refused("speed = 0.4").is_some());
    let blind = Bench::<WallFollower>::new("", Setup::default()).err().map(|error| error.key);
    assert_eq!(blind.as_deref(), Some("inputs.camera"));
}
