//! From a picture of the rendered office to the weights, and each step alone, on one core.
//!
//! `cargo bench -p yamabico-free-space-avoider --bench navel_grid`. Each measurement goes round twelve pictures of 340 x 180.
//! With `YAMABICO_FRAMES=DIR` (a full path) the pictures are kept there, for other programs to be timed on the same ones.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::NavelGridAvoider;
use yamabico_sim::random::stream;
use yamabico_sim::{Renderer, Scene, World};
use yamabico_vision::area_average::AreaAverage;
use yamabico_vision::dark_cells::DarkCells;
use yamabico_vision::isodata::threshold_of_pixels;
use yamabico_vision::median::Median3;

#[path = "../examples/office/mod.rs"]
mod office;
#[path = "../examples/office/world.rs"]
mod office_world;

const PLACES: u32 = 12;
const RUNS: usize = 200;

fn pictures(width: u32, height: u32) -> Vec<GrayImage> {
    let scene = Scene::new(&World::from_toml(office_world::OFFICE).unwrap(), 1).unwrap();
    let mut renderer = Renderer::new(office_world::photometry(), stream(1, "noise"));
    let folder = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from);
    (0..PLACES)
        .map(|place| {
            let at = f64::from(place);
            let robot = Pose2::new(1.5 + 0.5 * at, 2.9 + 0.3 * (2.0 * at).sin(), 0.9 * at);
            let image = office::render(&mut renderer, &scene, office::camera(width, height), robot).unwrap();
            if let Some(folder) = &folder {
                let path = folder.join(format!("office_{width}x{height}_{place:02}.png"));
                image::save_buffer(path, image.pixels(), width, height, image::ExtendedColorType::L8)
                    .unwrap();
            }
            image
        })
        .collect()
}

/// The quickest of many runs, which other programs on the machine disturb least.
fn best_us(mut run: impl FnMut()) -> f64 {
    (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            run();
            1e6 * begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn navel_grid(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("navel_grid");
    for (width, height) in [(340, 180), (640, 480)] {
        let (intrinsics, mount) = office::camera(width, height);
        let behavior = NavelGridAvoider::new(&Config::default(), &office::setup(intrinsics, mount)).unwrap();
        let mut sight = behavior.sight().clone();
        let pictures = pictures(width, height);
        let mut bests_us: Vec<f64> = pictures
            .iter()
            .map(|picture| {
                best_us(|| {
                    black_box(sight.see(black_box(picture.view().unwrap())));
                })
            })
            .collect();
        bests_us.sort_by(f64::total_cmp);
        let (median, largest) = (bests_us[bests_us.len() / 2], bests_us[bests_us.len() - 1]);
        println!(
            "picture to weights, {width}x{height}, best of {RUNS} a picture: median {median:.1} us, largest {largest:.1} us"
        );
        let mut next = 0;
        group.bench_function(format!("picture to weights, {width}x{height}"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % pictures.len();
                black_box(sight.see(black_box(pictures[next].view().unwrap())))
            });
        });
    }
    let pictures = pictures(340, 180);
    let (mut median, mut filtered) = (Median3::default(), GrayImage::default());
    let mut next = 0;
    group.bench_function("median", |bencher| {
        bencher.iter(|| {
            next = (next + 1) % pictures.len();
            median.filter(black_box(pictures[next].view().unwrap()), &mut filtered);
        });
    });
    let view = pictures[0].view().unwrap();
    println!("median, best {:.1} us", best_us(|| median.filter(black_box(view), &mut filtered)));
    let filtered: Vec<GrayImage> = pictures
        .iter()
        .map(|picture| {
            let mut filtered = GrayImage::default();
            median.filter(picture.view().unwrap(), &mut filtered);
            filtered
        })
        .collect();
    let pixels = filtered[0].pixels();
    let threshold_us = best_us(|| {
        black_box(threshold_of_pixels(black_box(pixels)).is_ok());
    });
    println!("threshold, best {threshold_us:.1} us");
    group.bench_function("threshold", |bencher| {
        bencher.iter(|| {
            next = (next + 1) % pictures.len();
            black_box(threshold_of_pixels(black_box(filtered[next].pixels())))
        });
    });
    let (mut cells, mut counts) = (DarkCells::default(), [0; 17 * 9]);
    let view = filtered[0].view().unwrap();
    println!("dark cells, best {:.1} us", best_us(|| cells.count(black_box(view), 120, 20, &mut counts)));
    group.bench_function("dark cells", |bencher| {
        bencher.iter(|| {
            next = (next + 1) % pictures.len();
            cells.count(black_box(filtered[next].view().unwrap()), 120, 20, &mut counts);
        });
    });
    let (mut average, mut scaled) = (AreaAverage::default(), GrayImage::new(340, 180));
    let large = GrayImage::new(640, 480);
    group.bench_function("area average from 640x480", |bencher| {
        bencher.iter(|| average.scale(black_box(large.view().unwrap()), &mut scaled));
    });
}

criterion_group!(benches, navel_grid);
criterion_main!(benches);
