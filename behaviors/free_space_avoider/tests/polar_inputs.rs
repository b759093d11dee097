//! Method polar-cells with valid, missing, malformed and misleading frames, and with unsuitable cameras.

use nalgebra::Vector2;
use yamabico_core::camera::{Intrinsics, MirrorCamera, Mount};
use yamabico_core::geometry::{Hypotenuse, Pose2, wrap_angle};
use yamabico_core::message::{
    Axes, Beam, Encoding, FrameHeader, FreeSpaceHeader, Goal, Kind, Odometry, Pose, PoseStatus, Proposal,
    RangeScanHeader, Reason,
};
use yamabico_core::sensor::SensorKind;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, GOAL, ODOMETRY, POSE, SONAR};
use yamabico_rigs::field;
use yamabico_sim::Scene;

/// Pose with a cube ahead.
const START: Pose2 = Pose2 { x: -0.75, y: 0.0, theta: 0.0 };

fn scene() -> Scene {
    field::scene()
}

fn render_with(camera: MirrorCamera, robot: Pose2) -> Vec<u8> {
    field::render(&mut field::renderer(camera), &scene(), robot)
}

fn render(robot: Pose2) -> Vec<u8> {
    render_with(field::camera(), robot)
}

fn bench(toml: &str) -> Bench<FreeSpaceAvoider> {
    let toml = field::CONFIG.to_owned() + toml;
    Bench::new(&toml, field::setup(field::camera(), Axes::ALL)).expect("a valid configuration")
}

/// Feeds an image and the odometry of a stopped robot.
fn show(bench: &mut Bench<FreeSpaceAvoider>, seconds: f64, pixels: &[u8]) -> Proposal {
    let odometry = Odometry { stamp_ns: Time::from_secs_f64(seconds).0, ..Odometry::default() };
    bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &field::frame_header(seconds), pixels);
    bench.propose()
}

fn show_often(bench: &mut Bench<FreeSpaceAvoider>, from_s: f64, pixels: &[u8], times: u32) -> Proposal {
    let mut last = Proposal::default();
    for time in 0..times {
        last = show(bench, from_s + 0.04 * f64::from(time), pixels);
    }
    last
}

fn speed(proposal: &Proposal) -> f64 {
    proposal.twist.linear.hypotenuse(proposal.twist.lateral)
}

fn is_standing(proposal: &Proposal) -> bool {
    proposal.kind() == Some(Kind::Drive) && speed(proposal) == 0.0 && proposal.twist.angular == 0.0
}

/// Changes the light of an image: multiplies each channel by a factor.
fn lit(pixels: &[u8], shares: [f64; 3]) -> Vec<u8> {
    pixels.iter().enumerate().map(|(i, &level)| (f64::from(level) * shares[i % 3]).min(255.0) as u8).collect()
}

#[test]
fn the_robot_drives_around_a_cube_and_publishes_free_space() {
    let mut bench = bench("");
    let pixels = render(START);
    assert!(is_standing(&show(&mut bench, 1.0, &pixels)), "a cell is free after two frames");
    let proposal = show(&mut bench, 1.04, &pixels);
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Drive), Some(Reason::Nominal)));
    assert!(speed(&proposal) > 0.09 && proposal.twist.lateral.abs() > 0.02, "{:?}", proposal.twist);
    assert_eq!(proposal.evidence_ns, Time::from_secs_f64(1.04).0);
    let published = bench.published::<FreeSpaceHeader>("free-space");
    let [(header, directions)] = &published[..] else { panic!("{} messages", published.len()) };
    assert_eq!((header.stamp_ns, directions.len()), (Time::from_secs_f64(1.04).0, 32));
    assert!(directions.is_sorted_by(|a, b| a.azimuth_rad < b.azimuth_rad));
    let scene = scene();
    let free_m = |azimuth_rad: f64| {
        let hits = |meters: &f64| {
            let ahead = Pose2::new(0.0, 0.0, azimuth_rad).transform_point([*meters, 0.0].into());
            let point = START.transform_point(ahead);
            yamabico_sim::clearance::to_solids(scene.solids(), [point.x, point.y], 0.0, 1.0) <= 0.0
        };
        (1..600).map(|step| 0.005 * f64::from(step)).find(hits).unwrap_or(3.0)
    };
    let edges_m = bench.behavior.polar_cells().expect("the method").observer().edges_m().to_vec();
    let mut blocked = 0;
    for direction in directions {
        let across = [-0.09, -0.045, 0.0, 0.045, 0.09].map(|aside| free_m(direction.azimuth_rad + aside));
        let farthest_m = across.into_iter().fold(0.0, f64::max);
        let published_m = direction.distance_m;
        // A fifth of the last free cell may be covered.
        let ring = edges_m.iter().filter(|&&edge| edge < published_m - 1e-9).count();
        let width_m = edges_m[ring] - edges_m[ring.saturating_sub(1)];
        assert!(
            published_m <= farthest_m + 0.3 * width_m,
            "{:.2}: {published_m} {farthest_m}",
            direction.azimuth_rad
        );
        blocked += u32::from(published_m < edges_m[edges_m.len() - 1]);
    }
    assert!((8..32).contains(&blocked), "{blocked}");
}

#[test]
fn a_nonholonomic_robot_drives_around_a_cube() {
    let toml = field::CONFIG;
    let mut bench =
        Bench::<FreeSpaceAvoider>::new(toml, field::setup(field::camera(), Axes::PLANAR)).expect("valid");
    let proposal = show_often(&mut bench, 1.0, &render(START), 3);
    assert_eq!((proposal.axes, proposal.reason()), (Axes::PLANAR, Some(Reason::Nominal)));
    assert!(proposal.twist.angular.abs() > 0.1 && proposal.twist.lateral == 0.0, "{:?}", proposal.twist);
}

#[test]
fn missing_stale_and_malformed_inputs_are_reported() {
    let pixels = render(START);
    let mut bench_ = bench("");
    assert_eq!(bench_.propose().reason(), Some(Reason::NoInput));
    bench_.at(1.0).feed(&CAMERA, &field::frame_header(1.0), &pixels);
    assert_eq!(bench_.propose().reason(), Some(Reason::NoInput), "no odometry yet");
    show_often(&mut bench_, 1.04, &pixels, 3);
    assert_eq!(bench_.at(1.3).propose().kind(), Some(Kind::Drive));
    assert_eq!(bench_.at(1.9).propose().reason(), Some(Reason::StaleInput));
    let good = field::frame_header(3.0);
    let broken = [
        FrameHeader { width: 220, ..good },
        FrameHeader { height: 221, ..good },
        FrameHeader { stride: 256, ..good },
        FrameHeader { encoding: Encoding::Gray8.code(), stride: 256, ..good },
        FrameHeader { encoding: 77, ..good },
        FrameHeader { stamp_ns: Time::from_secs_f64(9.0).0, ..good },
        FrameHeader { stamp_ns: Time::from_secs_f64(1.0).0, ..good },
    ];
    for (case, header) in broken.iter().enumerate() {
        let mut bench = bench("");
        show_often(&mut bench, 2.8, &pixels, 4);
        let proposal = bench.at(3.0).feed(&CAMERA, header, &pixels).propose();
        assert_eq!(
            (proposal.kind(), proposal.reason()),
            (Some(Kind::Abstain), Some(Reason::MalformedInput)),
            "{case}"
        );
        assert_eq!(show_often(&mut bench, 3.04, &pixels, 2).kind(), Some(Kind::Drive), "{case}: recovers");
    }
}

#[test]
fn without_floor_in_view_the_robot_stops_with_a_reason() {
    let pixels = render(START);
    for (color, at_start, later) in [
        ([0, 0, 0], Reason::FloorModelBroken, Reason::FloorModelBroken),
        ([255, 255, 255], Reason::FloorModelBroken, Reason::FloorModelBroken),
        ([120, 120, 120], Reason::LowContrast, Reason::LowContrast),
    ] {
        let covered: Vec<u8> = (0..256 * 220).flat_map(|_| color).collect();
        let mut bench_ = bench("");
        let proposal = show_often(&mut bench_, 1.0, &covered, 5);
        assert!(
            is_standing(&proposal) && proposal.reason() == Some(at_start),
            "{color:?}: {:?}",
            proposal.reason()
        );
        let mut bench_ = bench("");
        show_often(&mut bench_, 1.0, &pixels, 3);
        let proposal = show(&mut bench_, 1.2, &covered);
        assert!(speed(&proposal) == 0.0, "{color:?}: stands at once");
        let proposal = show_often(&mut bench_, 1.24, &covered, 5);
        assert!(
            is_standing(&proposal) && proposal.reason() == Some(later),
            "{color:?}: {:?}",
            proposal.reason()
        );
        assert!(bench_.published::<FreeSpaceHeader>("free-space").is_empty());
    }
}

#[test]
fn changed_light_stops_the_robot_until_the_ring_is_of_one_color() {
    let pixels = render(START);
    let yellow = lit(&pixels, [1.6, 0.75, 0.35]);
    let mut bench_ = bench("");
    show_often(&mut bench_, 1.0, &pixels, 3);
    assert_eq!(speed(&show(&mut bench_, 1.2, &yellow)), 0.0);
    let proposal = show_often(&mut bench_, 1.24, &yellow, 6);
    assert!(speed(&proposal) > 0.0, "the colors are taken again: {:?}", proposal.reason());
    // A slow change is tracked.
    let mut bench_ = bench("");
    for step in 0..400 {
        let share = 1.0 - 0.001 * f64::from(step);
        let proposal = show(&mut bench_, 1.0 + 0.04 * f64::from(step), &lit(&pixels, [1.0, share, share]));
        assert!(step < 2 || speed(&proposal) > 0.0, "step {step}: {:?}", proposal.reason());
    }
}

#[test]
fn a_moved_mirror_is_detected() {
    let shifted = |by: Vector2<f64>| {
        let camera = field::camera();
        let image = camera.image().with_center(camera.image().center() + by).expect("a center");
        render_with(MirrorCamera::new(image, camera.mirror().clone()).expect("a camera"), START)
    };
    for by in [Vector2::new(5.0, 0.0), Vector2::new(-3.0, 4.0), Vector2::new(0.0, -5.0)] {
        let proposal = show_often(&mut bench(""), 1.0, &shifted(by), 5);
        // At the start, the robot's own image may hide the floor ahead.
        assert!(is_standing(&proposal) && proposal.reason() != Some(Reason::Nominal), "{by}");
        let mut bench = bench("");
        show_often(&mut bench, 1.0, &render(START), 3);
        let proposal = show_often(&mut bench, 1.2, &shifted(by), 5);
        assert!(is_standing(&proposal), "{by}");
        assert_eq!(proposal.reason(), Some(Reason::Inconsistent), "{by}");
        assert!(proposal.note.as_str().contains("px off its"), "{}", proposal.note);
    }
    let mut bench = bench("");
    let proposal = show_often(&mut bench, 1.0, &shifted(Vector2::new(0.5, -0.5)), 5);
    assert!(speed(&proposal) > 0.0, "an offset of half a pixel is tolerated");
}

#[test]
fn the_robot_never_drives_into_the_hidden_half_of_the_ring() {
    let mut hidden = render(Pose2::new(0.0, -0.25, 0.0));
    for v in 0..220 {
        hidden[3 * 256 * v..3 * (256 * v + 128)].fill(60);
    }
    let mut bench = bench("goal_m = [0.0, 1.0]");
    let proposal = show_often(&mut bench, 1.0, &hidden, 6);
    assert!(speed(&proposal) == 0.0 || proposal.twist.lateral < 0.0, "{:?}", proposal.twist);
    assert!(speed(&proposal) <= 0.2, "and not fast: {:?} {}", proposal.twist, proposal.note);
}

#[test]
fn goals_are_reached_and_replaced_and_lost_with_the_pose() {
    let pixels = render(Pose2::new(-0.75, 0.35, 0.0));
    let mut bench_ = bench("goal_m = [0.05, 0.0]");
    let arrived = show_often(&mut bench_, 1.0, &pixels, 3);
    assert!(is_standing(&arrived) && arrived.note.as_str() == "arrived");
    let goal = Goal { x: -0.4, y: 0.35, theta: f64::NAN, tolerance_m: 0.05, sequence: 3, ..Goal::default() };
    let pose = Pose {
        stamp_ns: Time::from_secs_f64(1.2).0,
        x: -0.75,
        y: 0.35,
        status: PoseStatus::Tracking.code(),
        ..Pose::default()
    };
    bench_.feed(&GOAL, &goal, &[]).feed(&POSE, &pose, &[]);
    let proposal = show(&mut bench_, 1.2, &pixels);
    assert!(proposal.twist.linear > 0.0 && proposal.twist.lateral.abs() < 0.05, "{:?}", proposal.twist);
    bench_.feed(&POSE, &Pose { status: PoseStatus::Lost.code(), ..pose }, &[]);
    let lost = show(&mut bench_, 1.24, &pixels);
    assert!(is_standing(&lost) && lost.reason() == Some(Reason::Lost));
}

#[test]
fn free_distances_are_corrected_for_motion_since_the_frame() {
    let pixels = render(START);
    let mut bench = bench("");
    show_often(&mut bench, 1.0, &pixels, 3);
    let still = show(&mut bench, 1.2, &pixels);
    // Since the frame the robot has turned left by 90 degrees, and the goal in its frame right by as much.
    let turned = Odometry { theta: std::f64::consts::FRAC_PI_2, ..Odometry::default() };
    bench.at(1.24).feed(&ODOMETRY, &Odometry { stamp_ns: Time::from_secs_f64(1.24).0, ..turned }, &[]);
    let proposal = bench.propose();
    let direction = |p: &Proposal| p.twist.lateral.atan2(p.twist.linear);
    assert!(wrap_angle(direction(&proposal) - direction(&still) + turned.theta).abs() < 1e-6);
}

#[test]
fn unsuitable_cameras_are_rejected_with_a_remedy() {
    let refused = |setup, toml: &str| {
        Bench::<FreeSpaceAvoider>::new(&(field::CONFIG.to_owned() + toml), setup).err().expect("refused")
    };
    let setup = || field::setup(field::camera(), Axes::ALL);
    let pinhole = camera_setup(Intrinsics::from_horizontal_fov(256, 220, 1.5), Mount::level(0.3));
    assert!(refused(pinhole, "").problem.contains("mirror camera"));
    let mut blind = setup();
    blind.sensors.truncate(1);
    assert_eq!(refused(blind, "").key, "inputs.odometry");
    let mut leaning = setup();
    if let SensorKind::MirrorCamera { mount, .. } = &mut leaning.sensors[0].1.kind {
        mount.tilt = 0.1;
    }
    assert!(refused(leaning, "").problem.contains("upright"));
    let camera = field::camera();
    let image = camera.image().with_ring(22.0, 90.0).expect("a ring");
    let small = MirrorCamera::new(image, camera.mirror().clone()).expect("a camera");
    assert!(refused(field::setup(small, Axes::ALL), "").problem.contains("smaller max_range_m"));
    assert!(refused(setup(), "max_range_m = 0.2\nrings = 40").problem.contains("fewer rings"));
    assert_eq!(refused(setup(), "rings = 1").key, "rings");
    assert_eq!(refused(setup(), "floor_colors = 'nowhere.toml'").key, "floor_colors");
}

#[test]
fn an_echo_bounds_the_free_directions() {
    let open = Pose2 { x: 0.75, y: 0.0, theta: 0.0 };
    let pixels = render(open);
    let ends = |beams: &[Beam]| {
        let mut bench = bench("");
        for time in 0..3 {
            let seconds = 1.0 + 0.04 * f64::from(time);
            let stamp_ns = Time::from_secs_f64(seconds).0;
            bench.at(seconds).feed(&SONAR, &RangeScanHeader { stamp_ns, ..Default::default() }, beams);
            show(&mut bench, seconds, &pixels);
        }
        bench.published::<FreeSpaceHeader>("free-space")[0].1.clone()
    };
    let beam = Beam { azimuth_rad: 1.0, cone_rad: 0.2, range_m: 0.5, ..Beam::default() };
    let far = Beam { range_m: 3.0, ..beam };
    let mut blocked = 0;
    for (near, far) in ends(&[beam]).iter().zip(ends(&[far])) {
        let is_blocked = wrap_angle(near.azimuth_rad - 1.0).abs() < 0.12;
        assert!(near.distance_m <= far.distance_m + 1e-9);
        assert!(!is_blocked || near.distance_m <= 0.55, "{near:?}");
        blocked += u32::from(is_blocked);
    }
    assert!(blocked > 0);
}
