//! Speed of the vision modules on one core.
//!
//! `cargo bench -p yamabico-vision --bench vision`. The York Urban figure is the median over the images of the best of
//! 15 runs each; it needs the folder `york_urban` in `YAMABICO_DATA` (default ../shared/data beside the workspace).

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;
use yamabico_geometry::camera::{Calibration, Intrinsics, Mount};
use yamabico_geometry::image::{GrayImage, ImageView, RgbView};
use yamabico_vision::corridor_evidence::{self, Coefficients, CorridorJudge, RowPrior};
use yamabico_vision::floor_appearance::{self, FloorAppearance, FloorPlace};
use yamabico_vision::gradient::{Gradient, Scharr};
use yamabico_vision::median::Median3;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

/// Renders a corridor of flat shades with door frames, joints and noise; the vanishing point is at 52 % of the width and 46 % of the height.
fn corridor(width: usize, height: usize) -> GrayImage {
    let (vp_u, vp_v) = (0.52 * width as f64, 0.46 * height as f64);
    let mut noise = 1_u32;
    let mut image = GrayImage::new(width, height);
    for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
        let u = ((i % width) as f64 - vp_u) / width as f64;
        let v = ((i / width) as f64 - vp_v) / width as f64;
        // Distance ahead on the wall or the floor, and height on the wall.
        let depth = 0.12 / u.abs().max(1.3 * v.abs()).max(0.01);
        let is_wall = u.abs() > 1.3 * v.abs();
        let height_on_wall = v / u.abs().max(1e-3);
        let is_door = is_wall && (depth * 1.1).fract() < 0.45 && height_on_wall > -0.45;
        let is_joint = !is_wall && v > 0.0 && (u / v.abs().max(1e-3) * 2.5).fract().abs() < 0.06;
        let base = match (is_wall, is_door, is_joint) {
            (true, true, _) => 95.0,
            (true, false, _) if height_on_wall > 0.66 => 60.0,
            (true, false, _) => 160.0,
            (false, _, true) => 70.0,
            (false, _, false) if v > 0.0 => 105.0,
            (false, _, false) => 205.0,
        };
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *pixel = (base + f64::from(noise >> 24) / 32.0 - 4.0) as u8;
    }
    image
}

fn camera(width: usize, height: usize) -> Intrinsics {
    Intrinsics::from_horizontal_fov(width as u32, height as u32, 1.0)
}

struct Chain {
    detector: SegmentDetector,
    finder: VanishingPointFinder,
}

impl Chain {
    fn new() -> Self {
        Self {
            detector: SegmentDetector::new(SegmentConfig::default()),
            finder: VanishingPointFinder::new(VanishingPointConfig::default()),
        }
    }

    /// Number of segments, and true if a vanishing point was found.
    fn look(&mut self, image: ImageView, camera: &Intrinsics) -> (usize, bool) {
        match self.detector.detect(image) {
            Ok(segments) => (segments.len(), self.finder.find(segments, camera, None).is_ok()),
            Err(_) => (0, false),
        }
    }
}

fn kernels(criterion: &mut Criterion) {
    let image = corridor(640, 480);
    let Ok(view) = image.view() else { return };
    let (mut median, mut filtered) = (Median3::default(), GrayImage::default());
    criterion.bench_function("median3 640x480", |b| b.iter(|| median.filter(black_box(view), &mut filtered)));
    let (mut scharr, mut gradient) = (Scharr::default(), Gradient::default());
    criterion
        .bench_function("scharr 640x480", |b| b.iter(|| scharr.gradient(black_box(view), &mut gradient)));
    criterion.bench_function("binomial + scharr 640x480", |b| {
        b.iter(|| scharr.smoothed_gradient(black_box(view), &mut gradient));
    });
}

fn frames(criterion: &mut Criterion) {
    for (width, height) in [(640, 480), (256, 240)] {
        let image = corridor(width, height);
        let Ok(view) = image.view() else { return };
        let camera = camera(width, height);
        let mut chain = Chain::new();
        let (segments, found) = chain.look(view, &camera);
        println!("corridor {width}x{height}: {segments} segments, vanishing point found: {found}");
        criterion.bench_function(&format!("frame to vanishing point, corridor {width}x{height}"), |b| {
            b.iter(|| chain.look(black_box(view), &camera));
        });
        criterion.bench_function(&format!("segments, corridor {width}x{height}"), |b| {
            b.iter(|| chain.detector.detect(black_box(view)).map(<[_]>::len));
        });
        if let Ok(segments) = chain.detector.detect(view) {
            let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
            criterion.bench_function(&format!("vanishing point, corridor {width}x{height}"), |b| {
                b.iter(|| finder.find(black_box(segments), &camera, None).is_ok());
            });
        }
    }
}

/// Votes by the floor's look, of the corridor tinted by place so that it has colors.
fn floor_looks(criterion: &mut Criterion) {
    for (width, height) in [(640, 480), (256, 240)] {
        let gray = corridor(width, height);
        let tinted = |(i, &level): (usize, &u8)| {
            let share = if 2 * (i / width) > height { 200 } else { 240 };
            [level, (u16::from(level) * share / 256) as u8, level / 2]
        };
        let data: Vec<u8> = gray.pixels().iter().enumerate().flat_map(tinted).collect();
        let (Ok(color), Ok(gray)) = (RgbView::new(&data, width, height, 3 * width), gray.view()) else {
            return;
        };
        let mut appearance = FloorAppearance::default();
        for (name, picture) in [
            ("color", floor_appearance::Picture::Color(color)),
            ("gray", floor_appearance::Picture::Gray(gray)),
        ] {
            criterion.bench_function(&format!("floor by its look, {name} {width}x{height}"), |b| {
                b.iter(|| appearance.observe(black_box(picture), &FloorPlace::UNKNOWN_CAMERA).is_ok());
            });
        }
    }
}

fn york_urban(criterion: &mut Criterion) {
    let images = photographs();
    if images.is_empty() {
        println!("skipped: the York Urban images are missing (set YAMABICO_DATA)");
        return;
    }
    let camera = Intrinsics { fx: 674.918, fy: 674.918, cx: 307.551, cy: 251.454, width: 640, height: 480 };
    let mut chain = Chain::new();
    let (mut times_us, mut counts) = (Vec::new(), Vec::new());
    for image in &images {
        let Ok(view) = image.view() else { continue };
        let mut best = f64::INFINITY;
        for _ in 0..15 {
            let start = Instant::now();
            let (segments, _) = black_box(chain.look(view, &camera));
            best = best.min(start.elapsed().as_secs_f64() * 1e6);
            counts.push(segments as f64);
        }
        times_us.push(best);
    }
    println!(
        "York Urban, {} images: frame to vanishing point median {:.0} us, largest {:.0} us; segments median {:.0}",
        times_us.len(),
        middle(&mut times_us),
        times_us.last().copied().unwrap_or(f64::NAN),
        middle(&mut counts)
    );
    criterion.bench_function("frame to vanishing point, York Urban, all images", |b| {
        let mut next = 0;
        b.iter(|| {
            next = (next + 1) % images.len();
            images[next].view().map(|view| chain.look(view, &camera))
        });
    });
}

/// Time of the evidence for a corridor, given the segments: hypotheses, features and probability.
fn corridor_judgement(criterion: &mut Criterion) {
    let images = photographs();
    let camera = Intrinsics { fx: 674.918, fy: 674.918, cx: 307.551, cy: 251.454, width: 640, height: 480 };
    let picture = corridor_evidence::Picture::of(&camera);
    let prior = RowPrior::of_mount(&picture, &Mount::level(1.0), Calibration::Measured, None);
    let mut judge = CorridorJudge::new(Coefficients::SEGMENTS_2, 0.5);
    let mut detector = SegmentDetector::new(SegmentConfig::for_evidence());
    let mut times_us = Vec::new();
    for image in &images {
        let Ok(Ok(segments)) = image.view().map(|view| detector.detect(view)) else { continue };
        let mut best = f64::INFINITY;
        for _ in 0..15 {
            let start = Instant::now();
            black_box(judge.look(black_box(segments), &picture, &prior, None));
            best = best.min(start.elapsed().as_secs_f64() * 1e6);
        }
        times_us.push(best);
    }
    if !times_us.is_empty() {
        println!(
            "York Urban, {} images: evidence beside the segments median {:.0} us, largest {:.0} us",
            times_us.len(),
            middle(&mut times_us),
            times_us.last().copied().unwrap_or(f64::NAN)
        );
    }
    let image = corridor(640, 480);
    let Ok(Ok(segments)) = image.view().map(|view| detector.detect(view)) else { return };
    criterion.bench_function("evidence, corridor 640x480", |b| {
        b.iter(|| judge.look(black_box(segments), &picture, &prior, None).probability);
    });
}

/// Sorts the values and returns the median.
fn middle(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn photographs() -> Vec<GrayImage> {
    let Some(folder) = yamabico_testkit::data::data_set("york_urban") else { return Vec::new() };
    let mut files: Vec<_> = std::fs::read_dir(folder.join("images"))
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .collect();
    files.sort();
    let load = |path: &PathBuf| {
        let rgb = image::open(path).ok()?.to_rgb8();
        let (width, height) = (rgb.width() as usize, rgb.height() as usize);
        let mut gray = GrayImage::default();
        gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width).ok()?;
        Some(gray)
    };
    files.iter().filter_map(load).collect()
}

criterion_group!(vision, kernels, frames, corridor_judgement, floor_looks, york_urban);
criterion_main!(vision);
