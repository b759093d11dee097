//! Speed of radial edge detection in a mirror image of 512x480 pixels, on one core.
//!
//! `cargo bench -p yamabico-vision --bench radial_edges`. With `YAMABICO_FRAMES` set to a folder, the frame and the true
//! azimuths are written there for the peer of `tests/peers`.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use rand::{RngExt, SeedableRng};
use yamabico_geometry::camera::MirrorImage;
use yamabico_geometry::image::GrayImage;
use yamabico_geometry::wrap_angle;
use yamabico_vision::azimuth_profile::ProfileRule;
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

const SIZE: (usize, usize) = (512, 480);
const WALLS: usize = 24;

/// Walls of plain shades between 24 vertical edges, a floor whose border wanders, the robot in the middle, and noise of
/// 3 gray levels; with the azimuths of the edges.
fn ring(image: &MirrorImage) -> (GrayImage, Vec<f64>) {
    let mut random = rand_pcg::Pcg64::seed_from_u64(5);
    let mut edges: Vec<f64> = (0..WALLS).map(|_| random.random_range(0.0..TAU)).collect();
    edges.sort_by(f64::total_cmp);
    let shades: Vec<f64> = (0..=WALLS).map(|_| random.random_range(60.0..220.0)).collect();
    let mut frame = GrayImage::new(SIZE.0, SIZE.1);
    let rim = image.rim_radius_px();
    let shade = |u: f64, v: f64| {
        let pixel = [u, v].into();
        let radius = image.mirror_from_pixel(pixel).norm();
        let turn = image.azimuth_from_pixel(pixel).unwrap_or(0.0).rem_euclid(TAU);
        let floor = rim * (0.62 + 0.18 * (2.0 * turn + 0.5).sin() + 0.1 * (5.0 * turn + 1.0).sin());
        match radius {
            r if r < 0.15 * rim => 25.0,
            r if r > 0.98 * rim => 10.0,
            r if r < floor => 110.0,
            _ => shades[edges.partition_point(|edge| *edge < turn)],
        }
    };
    for (i, out) in frame.pixels_mut().iter_mut().enumerate() {
        let (u, v) = ((i % SIZE.0) as f64, (i / SIZE.0) as f64);
        let shift = |k: usize| (k as f64 - 1.0) / 3.0;
        let sum: f64 = (0..9).map(|k| shade(u + shift(k % 3), v + shift(k / 3))).sum();
        let noise: f64 = (0..4).map(|_| random.random_range(-1.0..1.0)).sum::<f64>() * 3.0 / 1.155;
        *out = (sum / 9.0 + noise).clamp(0.0, 255.0) as u8;
    }
    (frame, edges)
}

fn save(frame: &GrayImage, edges: &[f64]) -> std::io::Result<()> {
    let Some(folder) = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from) else { return Ok(()) };
    std::fs::create_dir_all(&folder)?;
    let path = folder.join("ring_512x480.png");
    image::save_buffer(path, frame.pixels(), SIZE.0 as u32, SIZE.1 as u32, image::ColorType::L8)
        .map_err(std::io::Error::other)?;
    let lines: Vec<String> = edges.iter().map(f64::to_string).collect();
    std::fs::write(folder.join("ring_512x480.txt"), lines.join("\n"))
}

fn radial(criterion: &mut Criterion) {
    let Ok(image) = MirrorImage::centered(512, 480).with_ring(20.0, 240.0) else { return };
    let (frame, truth) = ring(&image);
    if let Err(error) = save(&frame, &truth) {
        println!("could not write the image: {error}");
    }
    let Ok(view) = frame.view() else { return };
    let mut detector = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
    let Ok(found) = detector.find(view) else { return };
    let off = |truth: f64| {
        let errors = found.iter().map(|edge| wrap_angle(edge.azimuth_rad - truth).abs());
        errors.fold(f64::INFINITY, f64::min)
    };
    let errors: Vec<f64> =
        truth.iter().map(|&truth| off(truth)).filter(|e| *e < 1_f64.to_radians()).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
    println!(
        "{} edges; {} of {} true ones within 1 degree, rms {:.3} degrees",
        found.len(),
        errors.len(),
        truth.len(),
        rms.to_degrees()
    );
    let mut times: Vec<f64> = (0..3000)
        .map(|_| {
            let begin = Instant::now();
            black_box(detector.find(black_box(view)).map(<[_]>::len).is_ok());
            1e6 * begin.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_unstable_by(f64::total_cmp);
    println!("median of single runs {:.1} us", times[times.len() / 2]);
    criterion.bench_function("radial edges and azimuths 512x480", |b| {
        b.iter(|| detector.find(black_box(view)).map(<[_]>::len));
    });
}

criterion_group!(benches, radial);
criterion_main!(benches);
