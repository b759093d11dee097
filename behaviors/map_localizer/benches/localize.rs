//! One picture against the map: the whole behavior, and its steps.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix2, Vector2};
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::Odometry;
use yamabico_core::testing::Bench;
use yamabico_map_localizer::belief::{Belief, Update};
use yamabico_map_localizer::wire_frame::association::GATE;
use yamabico_map_localizer::wire_frame::fixer::Fixer;
use yamabico_map_localizer::wire_frame::matching::LineNoise;
use yamabico_map_localizer::wire_frame::projected_line::LineCamera;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};
use yamabico_vision::map::{Edge, ExpectationMap, ExpectationRules, WireFrame};

#[allow(dead_code, reason = "the bench drives nowhere")]
#[path = "../tests/rig/mod.rs"]
mod rig;

/// An edge of the map and the pixels where its ends were seen.
type SeenLine = (Edge, [Vector2<f64>; 2]);

const ROBOT: Pose2 = Pose2 { x: 3.0, y: 0.1, theta: 0.03 };

fn picture(intrinsics: Intrinsics, mount: Mount) -> GrayImage {
    let scene = Scene::new(&rig::empty_hallway(), 0).expect("a valid world");
    let mut image = GrayImage::new(intrinsics.width as usize, intrinsics.height as usize);
    Renderer::new(Photometry::default(), stream(3, "picture"))
        .render(&scene, &CameraView { intrinsics, mount, robot: ROBOT }, image.pixels_mut())
        .expect("a valid view");
    image
}

fn hallway() -> WireFrame {
    WireFrame::read(&rig::configs().join("maps/hallway.toml")).expect("the map")
}

/// Forty edges of the map with noisy ends as they would be seen, and a prior beside the truth: gate, project anew, update.
fn update(criterion: &mut Criterion) {
    let (intrinsics, mount) = rig::camera(640, 480);
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
            let update = belief.update(&line.residual(*ends), &noise, GATE);
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
        "40 edges: pose {x:.9} {y:.9} {theta:.9}, median {:?} a run, as the peer measures",
        runs[runs.len() / 2]
    );
    leave_for_peer(&intrinsics, &mount, &prior, &lines);
    criterion.bench_function("map_localizer/update/40_edges", |b| {
        b.iter(|| filter(black_box(prior), black_box(&lines)));
    });
}

/// The same problem for `tests/peers/p6_lines.cpp`, which tells the layout.
fn leave_for_peer(intrinsics: &Intrinsics, mount: &Mount, prior: &Belief, lines: &[SeenLine]) {
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
    numbers.extend([GATE, lines.len() as f64]);
    for (edge, ends) in lines {
        numbers.extend(edge.from.iter().chain(edge.to.iter()).chain(ends.iter().flatten()));
    }
    let folder = std::env::var_os("PEERS_DATA")
        .map_or_else(|| std::env::temp_dir().join("yamabico-peers"), PathBuf::from);
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_ne_bytes()).collect();
    if std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(folder.join("p6_lines.raw"), bytes))
        .is_err()
    {
        println!("the peer's problem could not be written to {}", folder.display());
    }
}

fn steps(criterion: &mut Criterion) {
    for (width, height) in [(256, 240), (640, 480)] {
        let (intrinsics, mount) = rig::camera(width, height);
        let image = picture(intrinsics, mount);
        let (map, pinhole) = (hallway(), Pinhole::ideal(intrinsics));
        let mut expectation = ExpectationMap::new(ExpectationRules::for_width(width));
        criterion.bench_function(&format!("map_localizer/expectation/{width}x{height}"), |b| {
            b.iter(|| expectation.compute(black_box(&map), &pinhole, &mount, &ROBOT).len());
        });
        let mut fixer = Fixer::new(map.clone(), pinhole, mount);
        fixer.take(image.view().expect("a picture")).expect("lines");
        let prior = Belief::new(Pose2::new(3.01, 0.09, 0.028), 0.02, 0.006);
        let noise = LineNoise { sigma_px: 0.7, map_sigma_m: 0.01, scale: 1.0, repetition: 1.0 };
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
        let config = rig::toml("route = [[12.5, 0.0]]\nstart = { x_m = 3.0, y_m = 0.1, heading_deg = 1.7 }");
        let mut bench = Bench::<MapLocalizer>::new(&config, rig::setup(width, height)).expect("valid");
        let mut step = 0_u32;
        criterion.bench_function(&format!("map_localizer/propose/{width}x{height}"), |b| {
            b.iter_batched(
                || {
                    step += 1;
                    f64::from(step) * 0.1
                },
                |seconds| {
                    let header = rig::frame_header(width, height, seconds);
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
