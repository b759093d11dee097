//! Run time of method navel-grid on one core: from an image of the rendered office to the weights, and each step.
//!
//! `cargo bench -p yamabico-free-space-avoider --bench navel_grid`. Each measurement cycles through twelve images of
//! 340 x 180. `YAMABICO_FRAMES=DIR` (an absolute path) saves the images, so that other programs can be timed on them.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::echoes::Echoes;
use yamabico_free_space_avoider::navel_grid::NavelGridAvoider;
use yamabico_free_space_avoider::navel_grid::area_average::AreaAverage;
use yamabico_free_space_avoider::navel_grid::dark_cells::DarkCells;
use yamabico_free_space_avoider::navel_grid::isodata::threshold_of_pixels;
use yamabico_rigs::office;
use yamabico_sim::Renderer;
use yamabico_sim::random::stream;
use yamabico_vision::floor_appearance::Picture;
use yamabico_vision::median::Median3;

const POSES: u32 = 12;
const RUNS: usize = 200;

fn images(width: u32, height: u32) -> Vec<GrayImage> {
    let scene = office::scene();
    let mut renderer = Renderer::new(office::photometry(), stream(1, "noise"));
    let folder = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from);
    (0..POSES)
        .map(|pose| {
            let at = f64::from(pose);
            let robot = Pose2::new(1.5 + 0.5 * at, 2.9 + 0.3 * (2.0 * at).sin(), 0.9 * at);
            let image = office::render(&mut renderer, &scene, office::camera(width, height), robot).unwrap();
            if let Some(folder) = &folder {
                let path = folder.join(format!("office_{width}x{height}_{pose:02}.png"));
                image::save_buffer(path, image.pixels(), width, height, image::ExtendedColorType::L8)
                    .unwrap();
            }
            image
        })
        .collect()
}

/// Measures the minimum time of many runs, us; other processes on the machine affect it least.
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
        let mut observer = behavior.observer().clone();
        let images = images(width, height);
        let none = Echoes::default();
        let mut bests_us: Vec<f64> = images
            .iter()
            .map(|image| {
                best_us(|| {
                    black_box(observer.observe(Picture::Gray(black_box(image.view().unwrap())), &none));
                })
            })
            .collect();
        bests_us.sort_by(f64::total_cmp);
        let (median, max) = (bests_us[bests_us.len() / 2], bests_us[bests_us.len() - 1]);
        println!(
            "image to weights, {width}x{height}, best of {RUNS} per image: median {median:.1} us, maximum {max:.1} us"
        );
        let mut next = 0;
        group.bench_function(format!("image to weights, {width}x{height}"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % images.len();
                black_box(observer.observe(Picture::Gray(black_box(images[next].view().unwrap())), &none))
            });
        });
    }
    let images = images(340, 180);
    let (mut median, mut filtered) = (Median3::default(), GrayImage::default());
    let mut next = 0;
    group.bench_function("median", |bencher| {
        bencher.iter(|| {
            next = (next + 1) % images.len();
            median.filter(black_box(images[next].view().unwrap()), &mut filtered);
        });
    });
    let view = images[0].view().unwrap();
    println!("median, best {:.1} us", best_us(|| median.filter(black_box(view), &mut filtered)));
    let filtered: Vec<GrayImage> = images
        .iter()
        .map(|image| {
            let mut filtered = GrayImage::default();
            median.filter(image.view().unwrap(), &mut filtered);
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
            next = (next + 1) % images.len();
            black_box(threshold_of_pixels(black_box(filtered[next].pixels())))
        });
    });
    let (mut cells, mut counts) = (DarkCells::default(), [0; 17 * 9]);
    let view = filtered[0].view().unwrap();
    println!("dark cells, best {:.1} us", best_us(|| cells.count(black_box(view), 120, 20, &mut counts)));
    group.bench_function("dark cells", |bencher| {
        bencher.iter(|| {
            next = (next + 1) % images.len();
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
