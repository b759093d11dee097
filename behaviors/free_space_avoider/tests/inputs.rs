//! Method navel-grid with valid, missing, stale and malformed frames, and with unsuitable cameras.

use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    Beam, FrameHeader, FreeSpaceHeader, Kind, Odometry, Proposal, RangeScanHeader, Reason,
};
use yamabico_core::range_scan::LaserScanner;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY, SONAR};
use yamabico_rigs::office;
use yamabico_sim::Renderer;
use yamabico_sim::random::stream;

const WIDTH: usize = 340;
const HEIGHT: usize = 180;

/// Free floor ahead, from the middle of the first room.
const FREE: Pose2 = Pose2 { x: 1.7, y: 2.6, theta: 0.0 };
/// Cupboard directly ahead.
const BLOCKED: Pose2 = Pose2 { x: 1.2, y: 2.6, theta: 3.1 };

fn render(robot: Pose2) -> GrayImage {
    let scene = office::scene();
    let mut renderer = Renderer::new(office::photometry(), stream(1, "noise"));
    office::render(&mut renderer, &scene, office::camera(WIDTH as u32, HEIGHT as u32), robot)
        .expect("an image")
}

fn bench(toml: &str) -> Bench<FreeSpaceAvoider> {
    let (intrinsics, mount) = office::camera(WIDTH as u32, HEIGHT as u32);
    Bench::new(toml, office::setup(intrinsics, mount)).expect("a valid configuration")
}

fn header(intrinsics: &Intrinsics, seconds: f64) -> FrameHeader {
    FrameHeader::gray(intrinsics.width, intrinsics.height, Time::from_secs_f64(seconds).0)
}

fn show(bench: &mut Bench<FreeSpaceAvoider>, seconds: f64, image: &GrayImage) -> Proposal {
    let (intrinsics, _) = office::camera(WIDTH as u32, HEIGHT as u32);
    bench.at(seconds).feed(&CAMERA, &header(&intrinsics, seconds), image.pixels()).propose()
}

fn flat(level: u8) -> GrayImage {
    let mut image = GrayImage::new(WIDTH, HEIGHT);
    image.pixels_mut().fill(level);
    image
}

fn negative(image: &GrayImage) -> GrayImage {
    let mut negative = image.clone();
    negative.pixels_mut().iter_mut().for_each(|pixel| *pixel = 255 - *pixel);
    negative
}

/// Replaces each pixel by the mean of the surrounding square.
fn blurred(image: &GrayImage, radius: usize) -> GrayImage {
    let view = image.view().expect("pixels");
    let mut blurred = image.clone();
    for v in 0..HEIGHT {
        for u in 0..WIDTH {
            let (mut sum, mut count) = (0_u32, 0);
            for y in v.saturating_sub(radius)..=(v + radius).min(HEIGHT - 1) {
                for x in u.saturating_sub(radius)..=(u + radius).min(WIDTH - 1) {
                    sum += u32::from(view.pixel(x, y));
                    count += 1;
                }
            }
            blurred.pixels_mut()[v * WIDTH + u] = (sum / count) as u8;
        }
    }
    blurred
}

fn is_standing(proposal: &Proposal) -> bool {
    proposal.kind() == Some(Kind::Drive) && proposal.twist.linear == 0.0 && proposal.twist.angular == 0.0
}

#[test]
fn drives_on_free_floor_and_turns_in_front_of_a_cupboard() {
    let mut bench = bench("");
    let proposal = show(&mut bench, 1.0, &render(FREE));
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Drive), Some(Reason::Nominal)));
    assert!((0.2..=0.3).contains(&proposal.twist.linear), "{}", proposal.twist.linear);
    assert_eq!(proposal.evidence_ns, Time::from_secs_f64(1.0).0);
    let proposal = show(&mut bench, 1.1, &render(BLOCKED));
    assert_eq!((proposal.twist.linear, proposal.twist.angular.abs()), (0.0, 0.4));
    assert_eq!((proposal.reason(), proposal.coupled), (Some(Reason::Searching), 0));
}

#[test]
fn free_space_is_published_from_right_to_left_and_never_too_far() {
    let mut bench = bench("");
    show(&mut bench, 1.0, &render(FREE));
    let published = bench.published::<FreeSpaceHeader>("free-space");
    let [(header, directions)] = &published[..] else { panic!("{} messages", published.len()) };
    assert_eq!((header.stamp_ns, header.evidence_ns), (1_000_000_000, 1_000_000_000));
    assert_eq!(directions.len(), 17);
    assert!(directions.is_sorted_by(|a, b| a.azimuth_rad < b.azimuth_rad));
    // Ground truth: distance from the robot's center to the first solid in a direction.
    let scene = office::scene();
    let free_m = |azimuth_rad: f64| {
        let hits = |meters: &f64| {
            let ahead = Pose2::new(0.0, 0.0, azimuth_rad).transform_point([*meters, 0.0].into());
            let point = FREE.transform_point(ahead);
            yamabico_sim::clearance::to_solids(scene.solids(), [point.x, point.y], 0.0, 1.0) <= 0.0
        };
        (1..2000).map(|step| 0.005 * f64::from(step)).find(hits).unwrap_or(10.0)
    };
    for direction in directions {
        // An obstacle in less than a quarter of a cell is not detected: the column is free only in a part of its width.
        let across = [-0.05, -0.025, 0.0, 0.025, 0.05].map(|aside| free_m(direction.azimuth_rad + aside));
        let farthest_m = across.into_iter().fold(0.0, f64::max);
        let (published_m, degrees) = (direction.distance_m, direction.azimuth_rad.to_degrees());
        assert!(
            published_m <= farthest_m,
            "{degrees:.0} degrees: published {published_m:.2} m, free {farthest_m:.2} m"
        );
    }
    show(&mut bench, 1.1, &flat(90));
    assert!(bench.published::<FreeSpaceHeader>("free-space").is_empty(), "published without an observation");
}

#[test]
fn missing_and_stale_frames_are_reported() {
    let mut bench = bench("");
    assert_eq!(bench.propose().reason(), Some(Reason::NoInput));
    show(&mut bench, 1.0, &render(FREE));
    assert_eq!(bench.at(1.4).propose().kind(), Some(Kind::Drive));
    let stale = bench.at(1.6).propose();
    assert_eq!((stale.kind(), stale.reason()), (Some(Kind::Abstain), Some(Reason::StaleInput)));
    assert_eq!(show(&mut bench, 1.7, &render(FREE)).kind(), Some(Kind::Drive));
}

#[test]
fn frames_of_wrong_size_encoding_or_time_are_rejected() {
    let image = render(FREE);
    let (intrinsics, _) = office::camera(WIDTH as u32, HEIGHT as u32);
    let good = header(&intrinsics, 2.0);
    let mut headers = vec![good; 6];
    headers[0].width = 640;
    headers[1].stride = 100;
    headers[2].encoding = 99;
    headers[3].stamp_ns = Time::from_secs_f64(5.0).0;
    headers[4].stamp_ns = Time::from_secs_f64(1.0).0;
    headers[5].height = 181;
    for (case, header) in headers.iter().enumerate() {
        let mut bench = bench("");
        show(&mut bench, 1.5, &image);
        let proposal = bench.at(2.0).feed(&CAMERA, header, image.pixels()).propose();
        assert_eq!(proposal.kind(), Some(Kind::Abstain), "case {case}");
        assert_eq!(proposal.reason(), Some(Reason::MalformedInput), "case {case}");
        let proposal = bench.at(2.1).feed(&CAMERA, &good, image.pixels()).propose();
        assert_eq!(proposal.kind(), Some(Kind::Drive), "case {case}: recovers");
    }
    let mut bench = bench("");
    let proposal = bench.at(2.0).feed(&CAMERA, &good, &image.pixels()[1..]).propose();
    assert_eq!(proposal.reason(), Some(Reason::MalformedInput), "too few bytes");
}

#[test]
fn dark_bright_and_covered_images_stop_the_robot() {
    let free = render(FREE);
    for level in [0, 90, 255] {
        let mut bench = bench("");
        show(&mut bench, 1.0, &free);
        for tenth in 11..60 {
            let proposal = show(&mut bench, 0.1 * f64::from(tenth), &flat(level));
            assert!(is_standing(&proposal), "level {level}");
            assert_eq!(proposal.reason(), Some(Reason::LowContrast), "level {level}");
        }
        assert!(show(&mut bench, 6.0, &free).twist.linear > 0.0, "level {level}: continues");
    }
    let mut dusk = free.clone();
    dusk.pixels_mut().iter_mut().for_each(|pixel| *pixel /= 12);
    let mut bench = bench("");
    assert_eq!(show(&mut bench, 1.0, &dusk).reason(), Some(Reason::LowContrast));
    // The lower three quarters of the image are covered.
    let mut covered = free.clone();
    covered.pixels_mut()[WIDTH * HEIGHT / 4..].fill(5);
    show(&mut bench, 1.1, &free);
    let proposal = show(&mut bench, 1.2, &covered);
    assert!(is_standing(&proposal), "{:?}", proposal.twist);
    assert_eq!(proposal.reason(), Some(Reason::FloorModelBroken));
}

#[test]
fn blurred_images_give_the_same_decisions() {
    for radius in [1, 3, 6] {
        let mut bench = bench("");
        assert!(show(&mut bench, 1.0, &blurred(&render(FREE), radius)).twist.linear > 0.0, "{radius}");
        let proposal = show(&mut bench, 1.1, &blurred(&render(BLOCKED), radius));
        assert_eq!(proposal.twist.linear, 0.0, "{radius}");
    }
}

#[test]
fn a_floor_of_the_other_polarity_stops_the_robot_unless_polarity_is_configured() {
    let (free, blocked) = (render(FREE), render(BLOCKED));
    let (dark_free, dark_blocked) = (negative(&free), negative(&blocked));
    let mut bright = bench("");
    let proposal = show(&mut bright, 1.0, &dark_free);
    assert!(is_standing(&proposal) && proposal.reason() == Some(Reason::FloorModelBroken));
    assert!(proposal.note.as_str().contains("polarity"), "{}", proposal.note);
    for toml in ["polarity = \"dark-floor\"", "polarity = \"auto\""] {
        let mut bench = bench(toml);
        assert!(show(&mut bench, 1.0, &dark_free).twist.linear > 0.0, "{toml}");
        assert_eq!(show(&mut bench, 1.1, &dark_blocked).twist.linear, 0.0, "{toml}");
    }
    let mut auto = bench("polarity = \"auto\"");
    assert!(show(&mut auto, 1.0, &free).twist.linear > 0.0);
    assert!(show(&mut auto, 1.1, &dark_free).twist.linear == 0.0, "the first frame decided");
}

#[test]
fn an_enclosed_robot_stops_after_a_full_turn_and_reports_it() {
    for has_odometry in [true, false] {
        let mut bench = bench("");
        let (free, blocked) = (render(FREE), render(BLOCKED));
        show(&mut bench, 1.0, &free);
        let (mut turned, mut seconds) = (0.0, 1.0);
        let enclosed = loop {
            seconds += 0.1;
            if has_odometry {
                let theta = yamabico_core::geometry::wrap_angle(turned);
                let stamp_ns = Time::from_secs_f64(seconds).0;
                bench.at(seconds).feed(&ODOMETRY, &Odometry { stamp_ns, theta, ..Odometry::default() }, &[]);
            }
            let proposal = show(&mut bench, seconds, &blocked);
            assert_eq!(proposal.twist.linear, 0.0);
            if proposal.twist.angular == 0.0 {
                break proposal;
            }
            turned += 0.1 * proposal.twist.angular;
        };
        assert_eq!(enclosed.reason(), Some(Reason::PassageBlocked));
        let full = std::f64::consts::TAU;
        assert!((full..full + 0.2).contains(&turned.abs()), "turned {turned}, odometry {has_odometry}");
        assert!(is_standing(&show(&mut bench, seconds + 0.1, &blocked)));
        assert!(show(&mut bench, seconds + 0.2, &free).twist.linear > 0.0, "the path is free again");
    }
}

#[test]
fn unsuitable_cameras_are_rejected_with_a_remedy() {
    let refused = |intrinsics: Intrinsics, mount: Mount, toml: &str| {
        Bench::<FreeSpaceAvoider>::new(toml, office::setup(intrinsics, mount)).err().expect("refused")
    };
    let (intrinsics, mount) = office::camera(340, 180);
    let upwards = refused(intrinsics, Mount { tilt: -0.8, ..mount }, "");
    assert!(upwards.problem.contains("no floor") && upwards.problem.contains("tilt"), "{upwards}");
    assert!(refused(intrinsics, Mount { z: 0.0, ..mount }, "").problem.contains("above the floor"));
    let far = refused(intrinsics, Mount { x: 0.8, ..mount }, "");
    assert!(far.problem.contains("stops within"), "{far}");
    assert_eq!(refused(intrinsics, Mount { z: f64::NAN, ..mount }, "").key, "inputs.camera");
    assert_eq!(refused(intrinsics, mount, "columns = 3").key, "columns");
}

#[test]
fn headings_by_clearance_agree_with_the_decisions() {
    let (intrinsics, mount) = office::camera(WIDTH as u32, HEIGHT as u32);
    let toml = "heading = 'clearance'";
    let refused =
        Bench::<FreeSpaceAvoider>::new(toml, office::setup(intrinsics, mount)).err().expect("refused");
    assert_eq!(refused.key, "inputs.odometry");
    let mut setup = office::setup(intrinsics, mount);
    let mut wheels = setup.sensors[0].1.clone();
    wheels.kind = yamabico_core::sensor::SensorKind::Other;
    setup.sensors.push(("odometry".into(), wheels));
    let mut bench = Bench::<FreeSpaceAvoider>::new(toml, setup).expect("a valid configuration");
    let proposal = show(&mut bench, 1.0, &render(FREE));
    assert_eq!(proposal.reason(), Some(Reason::Nominal));
    assert!(proposal.twist.linear > 0.05 && proposal.twist.angular.abs() <= 0.4, "{:?}", proposal.twist);
    let proposal = show(&mut bench, 1.1, &render(BLOCKED));
    assert_eq!((proposal.twist.linear, proposal.twist.angular.abs()), (0.0, 0.4));
}

/// Scan of a laser scanner, 3 m free all around but for one thing of 6 degrees ahead.
fn scan(ahead_m: f32) -> Vec<Beam> {
    let mount = Pose2::new(0.1, 0.0, 0.0);
    let step_rad = std::f64::consts::TAU / 360.0;
    let laser = LaserScanner { first_rad: 0.0, step_rad, min_m: 0.1, max_m: 5.0, mount };
    let ranges: Vec<f32> = (0..360).map(|i| if !(3..357).contains(&i) { ahead_m } else { 3.0 }).collect();
    let mut beams = Vec::new();
    laser.beams(ranges.into_iter(), &mut beams).expect("a scan");
    beams
}

fn show_with_scan(
    bench: &mut Bench<FreeSpaceAvoider>,
    seconds: f64,
    image: &GrayImage,
    ahead_m: f32,
) -> Proposal {
    let header = RangeScanHeader { stamp_ns: Time::from_secs_f64(seconds).0, ..RangeScanHeader::default() };
    bench.at(seconds).feed(&SONAR, &header, &scan(ahead_m));
    show(bench, seconds, image)
}

#[test]
fn floor_behind_an_echo_is_not_free() {
    let mut bench = bench("");
    let drives = show_with_scan(&mut bench, 1.0, &render(FREE), 2.9);
    assert!(drives.twist.linear > 0.2, "{:?}", drives.twist);
    let directions =
        |bench: &Bench<FreeSpaceAvoider>| bench.published::<FreeSpaceHeader>("free-space")[0].1.clone();
    let without = directions(&bench);
    // What the camera does not see, such as a pane of glass.
    let stops = show_with_scan(&mut bench, 1.1, &render(FREE), 0.4);
    assert_eq!((stops.kind(), stops.twist.linear), (Some(Kind::Drive), 0.0));
    let with = directions(&bench);
    assert_eq!(with.len(), without.len());
    for (with, without) in with.iter().zip(&without) {
        let is_ahead = without.azimuth_rad.abs() < 0.04;
        assert!(
            with.distance_m <= without.distance_m + 1e-9 && (!is_ahead || with.distance_m < 0.6),
            "{with:?}"
        );
        assert!(is_ahead || without.azimuth_rad.abs() < 0.2 || with.distance_m > without.distance_m - 1.0);
    }
}

#[test]
fn a_scanner_that_falls_silent_stops_the_behavior() {
    let mut bench = bench("");
    assert_eq!(show_with_scan(&mut bench, 1.0, &render(FREE), 2.9).kind(), Some(Kind::Drive));
    let image = render(FREE);
    for tenths in 11..15 {
        assert_eq!(show(&mut bench, 0.1 * f64::from(tenths), &image).kind(), Some(Kind::Drive));
    }
    let stale = show(&mut bench, 1.6, &image);
    assert_eq!((stale.kind(), stale.reason()), (Some(Kind::Abstain), Some(Reason::StaleInput)));
}
