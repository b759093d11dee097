//! Time of tracking both edges through rendered images, and of detecting them, on one core.
//!
//! `cargo bench -p yamabico-intersection-tracker`. With `YAMABICO_FRAMES=DIR` (a full path) the images are kept there, the
//! true columns of both edges in their names, for other programs to be timed on the same ones.

#![allow(clippy::unwrap_used, reason = "a benchmark may panic")]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;
use yamabico_core::camera::{Calibration, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_intersection_tracker::edge_template::{Aim, EdgeTemplate};
use yamabico_intersection_tracker::finder::{EndFinder, FinderRule};
use yamabico_intersection_tracker::landmarks::Motion;
use yamabico_intersection_tracker::template::correlation::correlation;
use yamabico_intersection_tracker::template::ssda::search;
use yamabico_intersection_tracker::template::{PatchOrigin, SearchArea, Template};
use yamabico_intersection_tracker::track::{IntersectionTrack, Sides};
use yamabico_intersection_tracker::{Config, IntersectionTracker};
use yamabico_rigs::approach::{END_M, Ending, approach, edge_column, wall_ends, world};
use yamabico_rigs::camera::forward_camera;
use yamabico_rigs::camera_drive::CameraDrive;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver};

/// Rounds over the images, of which the fastest counts: it is disturbed least by other programs.
const ROUNDS: u32 = 400;

fn benches(criterion: &mut Criterion) {
    let (intrinsics, mount) = forward_camera(640, 480, 60.0, 6.0);
    let start = Pose2::new(END_M - 6.0, 0.05, 0.0);
    let world = world(Ending::Crossing, 2.4);
    let mut drive: CameraDrive<IntersectionTracker> = approach(&world, start, (intrinsics, mount), 4.0, 1);
    let images: Vec<_> = (0..8).map(|_| drive.render()).collect();
    let views: Vec<_> = images.iter().map(|data| ImageView::new(data, 640, 480, 640).unwrap()).collect();
    let mut next = 0;
    let mut image = move || {
        next = (next + 1) % 8;
        next
    };

    let at = wall_ends(&world).map(|end| Vector2::new(edge_column(&drive.view, end).unwrap(), 181.0));
    if let Some(folder) = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from) {
        for (i, data) in images.iter().enumerate() {
            let path = folder.join(format!("intersection_640x480_{i}_{:.2}_{:.2}.png", at[0].x, at[1].x));
            image::save_buffer(path, data, 640, 480, image::ExtendedColorType::L8).unwrap();
        }
    }
    let mut templates = [Template::default(), Template::default()];
    for (template, at) in templates.iter_mut().zip(at) {
        template.take(views[0], PatchOrigin { u: at.x as usize - 10, v: 161 }, 20, 40).unwrap();
    }
    criterion.bench_function("SSDA and correlation, two 20x40 templates, 25 columns", |bencher| {
        bencher.iter(|| {
            let view = views[image()];
            for (template, at) in templates.iter().zip(at) {
                let middle = PatchOrigin { u: at.x as usize - 10, v: 161 };
                let area = SearchArea::along_row(view, template, middle, 12).unwrap();
                let best = search(view, template, &area, middle);
                black_box(correlation(view, template, best.position));
            }
        });
    });

    let aims = at.map(|pixel| Aim { pixel, gate_px: 4.0, depth_m: 6.0, lean: 0.0 });
    let mut edges = aims.map(|aim| {
        let mut edge = EdgeTemplate::new(640, 0.7);
        edge.acquire(views[0], &aim).unwrap();
        edge
    });
    criterion.bench_function("track of two 20x40 templates, every check", |bencher| {
        bencher.iter(|| {
            let view = views[image()];
            for (edge, aim) in edges.iter_mut().zip(&aims) {
                edge.track(view, aim).unwrap();
            }
        });
    });

    let rounds = (0..ROUNDS).map(|_| {
        let begin = Instant::now();
        for &view in &views {
            for (edge, aim) in edges.iter_mut().zip(&aims) {
                edge.track(view, aim).unwrap();
            }
        }
        1e6 * begin.elapsed().as_secs_f64() / views.len() as f64
    });
    let best_us = rounds.fold(f64::INFINITY, f64::min);
    println!(
        "track of two 20x40 templates, every check: best of {ROUNDS} rounds {best_us:.1} us per image\n"
    );

    let seen_by = CorridorCamera {
        pinhole: Pinhole::ideal(intrinsics),
        mount,
        calibration: Calibration::Measured,
        horizon_sigma_rad: 1_f64.to_radians(),
    };
    let mut sight = CorridorObserver::new(seen_by, FloorLineRule::default());
    let mut finder = EndFinder::default();
    let rule = FinderRule { range_m: [1.5, 12.0], border_px: 25.0, pair_m: 0.3 };
    let sighting = sight.observe(views[0], None).unwrap();
    finder.find(views[0], &sight, &sighting, &rule);
    let pair = finder.pair(&rule).unwrap();
    let mut track = IntersectionTrack::new(640, &Config::default());
    track.begin_pair(views[0], &Pose2::IDENTITY, &seen_by, &pair).unwrap();
    criterion.bench_function("follow both edges, with landmarks and heights", |bencher| {
        bencher.iter(|| {
            let pose = Pose2::IDENTITY;
            track.predict(Motion::Between(pose, pose));
            assert_eq!(track.follow(views[image()], &pose, &seen_by), Sides::Both);
        });
    });
    criterion.bench_function(
        "find the ends of both walls, 640x480, with vanishing point and floor lines",
        |bencher| {
            bencher.iter(|| {
                let view = views[image()];
                if let Ok(sighting) = sight.observe(view, None) {
                    black_box(finder.find(view, &sight, &sighting, &rule).len());
                }
            });
        },
    );
}

criterion_group!(track, benches);
criterion_main!(track);
