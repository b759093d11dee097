//! From an image of the rendered hallway to the vanishing point, segments included, on one core.
//!
//! `cargo bench -p yamabico-wall-follower --bench hallway`. For each size the median over twelve places of the best of many
//! runs each. With `YAMABICO_FRAMES=DIR` the images are kept there, for other programs to be timed on the same ones.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");
const PLACES: u32 = 12;
const RUNS: usize = 100;

fn main() {
    let scene = Scene::new(&World::from_toml(HALLWAY).unwrap(), 1).unwrap();
    let folder = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from);
    for (width, height) in [(640, 480), (256, 240)] {
        let intrinsics = Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians());
        let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "hallway"));
        let mut detector = SegmentDetector::new(SegmentConfig::default());
        let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
        let (mut times_us, mut counts, mut found) = (Vec::new(), Vec::new(), 0);
        for place in 0..PLACES {
            let at = f64::from(place);
            let robot = Pose2::new(at, 0.3 * (2.0 * at).sin(), 0.1 * (1.3 * at).cos());
            let view = CameraView { intrinsics, mount: Mount::tilted(0.6, 6_f64.to_radians()), robot };
            let mut pixels = vec![0; (width * height) as usize];
            renderer.render(&scene, &view, &mut pixels).unwrap();
            if let Some(folder) = &folder {
                let path = folder.join(format!("hallway_{width}x{height}_{place:02}.png"));
                image::save_buffer(path, &pixels, width, height, image::ExtendedColorType::L8).unwrap();
            }
            let (columns, rows) = (width as usize, height as usize);
            let image = ImageView::new(&pixels, columns, rows, columns).unwrap();
            let mut look = || {
                let segments = detector.detect(black_box(image)).unwrap();
                (segments.len(), finder.find(segments, &intrinsics, None).is_ok())
            };
            let (segments, is_found) = look();
            counts.push(segments as f64);
            found += u32::from(is_found);
            let mut best_us = f64::INFINITY;
            for _ in 0..RUNS {
                let begin = Instant::now();
                black_box(look());
                best_us = best_us.min(1e6 * begin.elapsed().as_secs_f64());
            }
            times_us.push(best_us);
        }
        println!(
            "hallway {width}x{height}, {PLACES} places: frame to vanishing point median {:.0} us, largest {:.0} us; \
             segments median {:.0}; found {found}",
            middle(&mut times_us),
            times_us[times_us.len() - 1],
            middle(&mut counts),
        );
    }
}

/// Sorts the values.
fn middle(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
