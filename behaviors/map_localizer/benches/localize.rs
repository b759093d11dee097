//! Time to localize with one image: the whole behavior and its steps.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix2, Vector2};
use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::Odometry;
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_map_localizer::belief::{Belief, Update};
use yamabico_map_localizer::wire_frame::association::GATE_99;
use yamabico_map_localizer::wire_frame::fixer::Fixer;
use yamabico_map_localizer::wire_frame::matching::LineNoise;
use yamabico_map_localizer::wire_frame::projected_line::LineCamera;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_rigs::camera::{empty_hallway, forward_camera, frame_header};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};
use yamabico_vision::map::{Edge, ExpectationMap, ExpectationRules, WireFrame};

/// Map edge and the pixels of its observed ends.
type SeenLine = (Edge, [Vector2<f64>; 2]);

const ROBOT: Pose2 = Pose2 { x: 3.0, y: 0.1, theta: 0.03 };

fn render(intrinsics: Intrinsics, mount: Mount) -> GrayImage {
    let scene = Scene::new(&empty_hallway(), 0).expect("a valid world");
    let mut image = GrayImage::new(intrinsics.width as usize, intrinsics.height as usize);
    Renderer::new(Photometry::default(), stream(3, "picture"))
        .render(&scene, &CameraView { intrinsics, mount, robot: ROBOT }, image.pixels_mut())
        .expect("a valid view");
    image
}

fn hallway() -> WireFrame {
    WireFrame::read(&yamabico_testkit::config("maps/hallway.toml")).expect("the map")
}

/// Measures 40 edges with noisy ends and an inaccurate prior: projection, gate and update in sequence.
fn update(criterion: &mut Criterion) {
    let (intrinsics, mount) = forward_camera(640, 480, 60.0, 6.0);
    let (map, pinhole) = (hallway(), Pinhole::ideal(intrinsics));
    let mut expectation = ExpectationMap::new(ExpectationRules::everything());
    let seen: Vec<_> = expectation.compute(&map, &pinhole, &mount, &ROBOT).iter().copied().take(40).collect();
    assert_eq!(seen.len(), 40, "the hallway shows enough edges");
    let lines: Vec<_> = seen
        .iter()
        .enumerate()
        .map(|(i, edge)| {
            let off = 0.4 * (i as f64 * 2.4).sin();
            (map.edges()[edge.edge], [edge.from, edge.to].map(|p| p + Vector2::new(off, -off)))
        })
        .collect();
    let camera = LineCamera::new(&intrinsics, &mount);
    let prior = Belief::new(Pose2::new(3.02, 0.08, 0.025), 0.05, 0.02);
    let noise = Matrix2::identity();
    let filter = |prior: Belief, lines: &[SeenLine]| {
        let (mut belief, mut applied) = (prior, 0);
        for (edge, ends) in lines {
            let Some(line) = camera.at(&belief.pose).project(edge) else { continue };
            let update = belief.update(&line.residual(*ends), &noise, GATE_99);
            applied += usize::from(matches!(update, Update::Applied(_)));
        }
        assert!(applied >= 38, "{applied}");
        belief
    };
    let Pose2 { x, y, theta } = filter(prior, &lines).pose;
    let mut runs: Vec<_> = (0..20_000)
        .map(|_| {
            let from = Instant::now();
            black_box(filter(black_box(prior), black_box(&lines)));
            from.elapsed()
        })
        .collect();
    runs.sort_unstable();
    println!(
        "40 edges: pose {x:.9} {y:.9} {theta:.9}, median {:?} per run, measured like the peer",
        runs[runs.len() / 2]
    );
    save_for_peer(&intrinsics, &mount, &prior, &lines);
    criterion.bench_function("map_localizer/update/40_edges", |b| {
        b.iter(|| filter(black_box(prior), black_box(&lines)));
    });
}

/// Writes the problem for `tests/peers/line_update_eigen.cpp`, which documents the layout.
fn save_for_peer(intrinsics: &Intrinsics, mount: &Mount, prior: &Belief, lines: &[SeenLine]) {
    let rotation = mount.rotation_body_from_camera().transpose();
    let mut numbers = vec![intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy];
    numbers.extend(rotation.transpose().iter());
    numbers.extend((rotation * mount.position_in_body()).iter());
    numbers.extend([
        prior.pose.x,
        prior.pose.y,
        prior.pose.theta,
        prior.sigma_xy_m(),
        prior.sigma_theta_rad(),
    ]);
    numbers.extend([GATE_99, lines.len() as f64]);
    for (edge, ends) in lines {
        numbers.extend(edge.from.iter().chain(edge.to.iter()).chain(ends.iter().flatten()));
    }
    let folder = std::env::var_os("PEERS_DATA")
        .map_or_else(|| std::env::temp_dir().join("yamabico-peers"), PathBuf::from);
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_ne_bytes()).collect();
    if std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(folder.join("line_update.raw"), bytes))
        .is_err()
    {
        println!("could not write the problem for the peer to {}", folder.display());
    }
}

fn steps(criterion: &mut Criterion) {
    for (width, height) in [(256, 240), (640, 480)] {
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 6.0);
        let image = render(intrinsics, mount);
        let (map, pinhole) = (hallway(), Pinhole::ideal(intrinsics));
        let mut expectation = ExpectationMap::new(ExpectationRules::for_width(width));
        criterion.bench_function(&format!("map_localizer/expectation/{width}x{height}"), |b| {
            b.iter(|| expectation.compute(black_box(&map), &pinhole, &mount, &ROBOT).len());
        });
        let mut fixer = Fixer::new(map.clone(), pinhole, mount);
        fixer.observe(image.view().expect("an image")).expect("lines");
        let prior = Belief::new(Pose2::new(3.01, 0.09, 0.028), 0.02, 0.006);
        let noise = LineNoise { sigma_px: 0.7, map_sigma_m: 0.01, scale: 1.0, correlation: 1.0 };
        criterion.bench_function(&format!("map_localizer/match_and_update/{width}x{height}"), |b| {
            b.iter(|| fixer.fix(black_box(&prior), &noise).lines);
        });
        let fix = fixer.fix(&prior, &noise);
        println!(
            "{width}x{height}: {} edges expected, {} segments, {} lines matched",
            fix.expected,
            fixer.segments().len(),
            fix.lines
        );
        let config = "map = \"maps/hallway.toml\"\nroute = [[12.5, 0.0]]\n\
                      start = { x_m = 3.0, y_m = 0.1, heading_deg = 1.7 }";
        let setup = Setup {
            folder: yamabico_testkit::configs(),
            robot: Robot { radius_m: 0.2, ..Robot::default() },
            ..camera_setup(intrinsics, mount)
        };
        let mut bench = Bench::<MapLocalizer>::new(config, setup).expect("valid");
        let mut step = 0_u32;
        criterion.bench_function(&format!("map_localizer/propose/{width}x{height}"), |b| {
            b.iter_batched(
                || {
                    step += 1;
                    f64::from(step) * 0.1
                },
                |seconds| {
                    let header = frame_header(&intrinsics, seconds);
                    let odometry = Odometry { stamp_ns: header.stamp_ns, ..Odometry::default() };
                    bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, image.pixels());
                    bench.propose()
                },
                criterion::BatchSize::SmallInput,
            );
        });
        assert!(bench.behavior.last_fix().is_some_and(|fix| fix.verdict.is_ok()));
    }
}

criterion_group!(benches, update, steps);
criterion_main!(benches);
