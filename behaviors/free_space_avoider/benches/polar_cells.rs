//! Run time of method polar-cells on one core: from a color image of the field to free distances, and from these to a
//! direction.
//!
//! `cargo bench -p yamabico-free-space-avoider --bench polar_cells`. The measurements of images cycle through twelve of
//! 256 x 220. `YAMABICO_FRAMES=DIR` (an absolute path) saves the images, so that other programs can be timed on them.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use std::f64::consts::PI;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use yamabico_core::camera::Mount;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::RgbView;
use yamabico_free_space_avoider::config::{Config, Method};
use yamabico_free_space_avoider::direction::{
    ChoiceRules, Chooser, FreeDistances, HeadingRules, PreviousChoice, Rollout, Start, Velocity,
};
use yamabico_free_space_avoider::polar_cells::RingObserver;
use yamabico_free_space_avoider::polar_cells::ring_cells::RingCells;
use yamabico_rigs::field;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::{ColorBox, ColorTable, FloorColors};
use yamabico_vision::morphology::Morphology;

const POSES: u32 = 12;
const RUNS: usize = 300;
const SCENES: u32 = 3000;
const GREEN: ColorBox = ColorBox { min: [30, 110, 50], max: [115, 210, 140] };

fn images() -> Vec<Vec<u8>> {
    let scene = field::scene();
    let mut renderer = field::renderer(field::camera());
    let folder = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from);
    (0..POSES)
        .map(|pose| {
            let at = f64::from(pose);
            let robot = Pose2::new(0.9 * (0.7 * at).sin(), 0.5 * (1.9 * at).cos(), 0.9 * at);
            let pixels = field::render(&mut renderer, &scene, robot);
            if let Some(folder) = &folder {
                let path = folder.join(format!("field_256x220_{pose:02}.png"));
                image::save_buffer(path, &pixels, 256, 220, image::ExtendedColorType::Rgb8).unwrap();
            }
            pixels
        })
        .collect()
}

fn view(pixels: &[u8]) -> RgbView<'_> {
    RgbView::new(pixels, 256, 220, 3 * 256).unwrap()
}

/// Measures the minimum time of many runs, us; other processes on the machine affect it least.
fn best_us(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let begin = Instant::now();
            run();
            1e6 * begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Returns median and maximum.
fn spread(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    (values[values.len() / 2], values[values.len() - 1])
}

fn observing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("polar_cells");
    let images = images();
    let mut table = ColorTable::default();
    table.insert_box(&GREEN);
    let config = Config { method: Method::PolarCells, closing_px: 2, ..Config::default() };
    let colors = [("thresholds", FloorColors::Box(GREEN)), ("table", FloorColors::Table(table))];
    for (name, colors) in &colors {
        let mount = Mount::level(field::LENS_M);
        let learned = Some(colors.clone());
        let mut observer =
            RingObserver::new(&config, &field::camera(), &mount, field::RADIUS_M, learned).unwrap();
        let times = images.iter().map(|pixels| {
            best_us(RUNS, || {
                black_box(observer.distances_of(black_box(view(pixels))));
            })
        });
        let (median, max) = spread(times.collect());
        println!(
            "color to distances, {name}, best of {RUNS} per image: median {median:.1} us, maximum {max:.1} us"
        );
        let mut next = 0;
        group.bench_function(format!("color to distances, {name}"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % images.len();
                black_box(observer.distances_of(black_box(view(&images[next]))).len())
            });
        });
        println!("free rings {:?}", observer.free().rings());
        let mut checked =
            RingObserver::new(&config, &field::camera(), &mount, field::RADIUS_M, None).unwrap();
        let checked_us = best_us(RUNS, || {
            black_box(checked.observe(black_box(view(&images[0]))).is_ok());
        });
        println!(
            "color to distances, {name}, with failure checks and tracking of the colors: {checked_us:.1} us"
        );
    }
    // Each step alone.
    let edges: Vec<f64> = (0..7).map(|i| 24.0 + 12.0 * f64::from(i)).collect();
    let cells = RingCells::new(field::camera().image(), &edges, 32, 5.0).unwrap();
    let (mut mask, mut morphology, mut counts) = (BitImage::default(), Morphology::default(), Vec::new());
    let pixels = view(&images[0]);
    let all = vec![0..256; 220];
    for (name, colors) in &colors {
        for (region, columns) in [("all columns", &all[..]), ("ring", cells.columns())] {
            let us = best_us(RUNS, || colors.mark(black_box(pixels), columns, &mut mask));
            println!("floor colors, {name}, {region}: best {us:.1} us");
        }
    }
    println!("closing, n = 2: best {:.1} us", best_us(RUNS, || morphology.close(black_box(&mut mask), 2)));
    println!("counts: best {:.1} us", best_us(RUNS, || cells.count(black_box(&mask), &mut counts)));
}

const RULES: ChoiceRules = ChoiceRules {
    speed_mps: 0.4,
    acceleration_mps2: 0.3,
    clearance_m: 0.1,
    step_s: 0.02,
    reaction_s: 0.04,
    velocity: Velocity::Considered,
    side_change_rad: 0.0,
    nearer_m: 0.0,
    deviation_rad: [0.0, 7.0],
};
const HEADING: HeadingRules = HeadingRules {
    speed_mps: 0.4,
    acceleration_mps2: 0.3,
    turn_radps: 3.0,
    turn_acceleration_radps2: 8.0,
    gain_per_s: 4.0,
    step_s: 0.04,
    horizon_s: 2.0,
    clearance_m: 0.1,
    side_change_rad: 0.0,
    deviation_rad: [0.0, 7.0],
};

fn choosing(criterion: &mut Criterion) {
    let edges_m = [0.092, 0.146, 0.214, 0.305, 0.441, 0.679, 1.228];
    let mut random = Pcg64::seed_from_u64(1);
    let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.228);
    let mut chooser = Chooser::default();
    let (mut holonomic, mut nonholonomic) = (Vec::new(), Vec::new());
    let mut worst = (0.0, None);
    for _ in 0..SCENES {
        // From crowded to open scenes, some enclosed by walls.
        let min_rings = random.random_range(1..4);
        let max_rings = random.random_range(min_rings..7);
        let width = random.random_range(1..6);
        let rings: Vec<usize> = (0..32_usize.div_ceil(width))
            .flat_map(|_| vec![random.random_range(min_rings..=max_rings); width])
            .take(32)
            .collect();
        free.set(rings.iter().map(|&ring| edges_m[ring]));
        let (speed, azimuth) = (random.random_range(0.0..0.4), random.random_range(-PI..PI));
        let velocity_mps = Vector2::new(speed * azimuth.cos(), speed * azimuth.sin());
        let start = Start { velocity_mps, ..Start::default() };
        let goal = random.random_range(-PI..PI);
        let us = best_us(20, || {
            black_box(chooser.choose_speed(
                black_box(&free),
                &start,
                goal,
                &PreviousChoice::default(),
                &RULES,
            ));
        });
        holonomic.push(us);
        if us > worst.0 {
            worst = (us, Some((free.clone(), start, goal)));
        }
        let turning = Rollout::new(Vector2::zeros(), 0.0, speed, random.random_range(-2.0..2.0));
        nonholonomic.push(best_us(20, || {
            black_box(chooser.choose_heading_speed(black_box(&free), &turning, goal, 0, &HEADING));
        }));
    }
    for (drive, times) in [("holonomic", holonomic), ("nonholonomic", nonholonomic)] {
        let (median, max) = spread(times);
        println!("choice in {SCENES} random scenes, {drive}: median {median:.1} us, maximum {max:.1} us");
    }
    if let (_, Some((free, start, goal))) = worst {
        criterion.bench_function("direction choice, worst scene", |bencher| {
            bencher.iter(|| {
                black_box(chooser.choose_speed(
                    black_box(&free),
                    &start,
                    goal,
                    &PreviousChoice::default(),
                    &RULES,
                ))
            });
        });
    }
}

criterion_group!(benches, observing, choosing);
criterion_main!(benches);
