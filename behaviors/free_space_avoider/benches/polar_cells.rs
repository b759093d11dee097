//! From a color picture of the field to free distances all around, and from these to a direction, on one core.
//!
//! `cargo bench -p yamabico-free-space-avoider --bench polar_cells`. The measurements of pictures go round twelve of 256 x 220. With
//! `YAMABICO_FRAMES=DIR` (a full path) the pictures are kept there, for other programs to be timed on the same ones.

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
    Before, ChoiceRules, Chooser, FreeDistances, HeadingRules, Rollout, Start, Velocity,
};
use yamabico_free_space_avoider::polar_cells::RingSight;
use yamabico_sim::{Scene, World};
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::{ColorBox, ColorTable, FloorColors};
use yamabico_vision::morphology::Morphology;
use yamabico_vision::ring_cells::RingCells;

#[path = "../examples/field/mod.rs"]
mod field;

const PLACES: u32 = 12;
const RUNS: usize = 300;
const SCENES: u32 = 3000;
const GREEN: ColorBox = ColorBox { least: [30, 110, 50], most: [115, 210, 140] };

fn pictures() -> Vec<Vec<u8>> {
    let scene = Scene::new(&World::from_toml(field::FIELD).unwrap(), 1).unwrap();
    let mut renderer = field::renderer(field::camera());
    let folder = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from);
    (0..PLACES)
        .map(|place| {
            let at = f64::from(place);
            let robot = Pose2::new(0.9 * (0.7 * at).sin(), 0.5 * (1.9 * at).cos(), 0.9 * at);
            let pixels = field::render(&mut renderer, &scene, robot);
            if let Some(folder) = &folder {
                let path = folder.join(format!("field_256x220_{place:02}.png"));
                image::save_buffer(path, &pixels, 256, 220, image::ExtendedColorType::Rgb8).unwrap();
            }
            pixels
        })
        .collect()
}

fn view(pixels: &[u8]) -> RgbView<'_> {
    RgbView::new(pixels, 256, 220, 3 * 256).unwrap()
}

/// The quickest of many runs, which other programs on the machine disturb least.
fn best_us(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let begin = Instant::now();
            run();
            1e6 * begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Median and largest.
fn spread(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    (values[values.len() / 2], values[values.len() - 1])
}

fn seeing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("polar_cells");
    let pictures = pictures();
    let mut table = ColorTable::default();
    table.insert_box(&GREEN);
    let config = Config { method: Method::PolarCells, closing_px: 2, ..Config::default() };
    let colors = [("thresholds", FloorColors::Box(GREEN)), ("table", FloorColors::Table(table))];
    for (name, colors) in &colors {
        let mount = Mount::level(field::LENS_M);
        let learned = Some(colors.clone());
        let mut sight = RingSight::new(&config, &field::camera(), &mount, field::RADIUS_M, learned).unwrap();
        let times = pictures.iter().map(|pixels| {
            best_us(RUNS, || {
                black_box(sight.distances_of(black_box(view(pixels))));
            })
        });
        let (median, largest) = spread(times.collect());
        println!(
            "color to distances, {name}, best of {RUNS} a picture: median {median:.1} us, largest {largest:.1} us"
        );
        let mut next = 0;
        group.bench_function(format!("color to distances, {name}"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % pictures.len();
                black_box(sight.distances_of(black_box(view(&pictures[next]))).len())
            });
        });
        println!("free rings {:?}", sight.free().rings());
        let mut whole = RingSight::new(&config, &field::camera(), &mount, field::RADIUS_M, None).unwrap();
        let everything_us = best_us(RUNS, || {
            black_box(whole.see(black_box(view(&pictures[0]))).is_ok());
        });
        println!(
            "the same with all looks at what may be wrong, and with colors followed: {everything_us:.1} us"
        );
    }
    // Each step alone, over the whole picture.
    let edges: Vec<f64> = (0..7).map(|i| 24.0 + 12.0 * f64::from(i)).collect();
    let cells = RingCells::new(field::camera().image(), &edges, 32, 5.0).unwrap();
    let (mut mask, mut morphology, mut counts) = (BitImage::default(), Morphology::default(), Vec::new());
    let pixels = view(&pictures[0]);
    let all = vec![0..256; 220];
    for (name, colors) in &colors {
        for (what, columns) in [("whole picture", &all[..]), ("ring", cells.columns())] {
            let us = best_us(RUNS, || colors.mark(black_box(pixels), columns, &mut mask));
            println!("floor colors, {name}, {what}: best {us:.1} us");
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
    let (mut sideways, mut ahead) = (Vec::new(), Vec::new());
    let mut worst = (0.0, None);
    for _ in 0..SCENES {
        // From crowded to open, some as walls that close in all around.
        let least = random.random_range(1..4);
        let most = random.random_range(least..7);
        let width = random.random_range(1..6);
        let rings: Vec<usize> = (0..32_usize.div_ceil(width))
            .flat_map(|_| vec![random.random_range(least..=most); width])
            .take(32)
            .collect();
        free.set(rings.iter().map(|&ring| edges_m[ring]));
        let (speed, way) = (random.random_range(0.0..0.4), random.random_range(-PI..PI));
        let start =
            Start { velocity_mps: Vector2::new(speed * way.cos(), speed * way.sin()), ..Start::default() };
        let goal = random.random_range(-PI..PI);
        let us = best_us(20, || {
            black_box(chooser.choose_speed(black_box(&free), &start, goal, &Before::default(), &RULES));
        });
        sideways.push(us);
        if us > worst.0 {
            worst = (us, Some((free.clone(), start, goal)));
        }
        let turning = Rollout::new(Vector2::zeros(), 0.0, speed, random.random_range(-2.0..2.0));
        ahead.push(best_us(20, || {
            black_box(chooser.choose_heading_speed(black_box(&free), &turning, goal, 0, &HEADING));
        }));
    }
    for (what, times) in [("sideways", sideways), ("ahead and turning", ahead)] {
        let (median, largest) = spread(times);
        println!(
            "choice of {SCENES} random scenes, {what}, up to three speeds: median {median:.1} us, largest {largest:.1} us"
        );
    }
    if let (_, Some((free, start, goal))) = worst {
        criterion.bench_function("direction choice, worst scene", |bencher| {
            bencher.iter(|| {
                black_box(chooser.choose_speed(black_box(&free), &start, goal, &Before::default(), &RULES))
            });
        });
    }
}

criterion_group!(benches, seeing, choosing);
criterion_main!(benches);
