//! Vertical edges and their difference in five regions; and the whole detector on a frame of the hallway.
//!
//! `cargo bench -p yamabico-stationary-obstacle-avoider --bench vertical_edges`. The image and the expected edges are those of
//! `tests/peers/vertical_edges_speed.py` if present in the temporary folder, otherwise the image is rendered.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::regions::Regions;
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;
use yamabico_stationary_obstacle_avoider::vertical_edges::{EdgeDifference, VerticalEdges};
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::map::WireFrame;

const SIZE: (usize, usize) = (256, 240);

fn peers() -> PathBuf {
    std::env::var_os("PEERS_DATA").map_or_else(|| std::env::temp_dir().join("yamabico-peers"), PathBuf::from)
}

fn rendered(robot: Pose2, intrinsics: Intrinsics, mount: Mount) -> Vec<u8> {
    let world = World::from_toml(include_str!("../../../configs/worlds/hallway.toml")).unwrap();
    let scene = Scene::new(&world, 1).unwrap();
    let mut pixels = vec![0; SIZE.0 * SIZE.1];
    Renderer::new(Photometry::default(), random::stream(1, "bench"))
        .render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
        .unwrap();
    pixels
}

fn benches(criterion: &mut Criterion) {
    let intrinsics = Intrinsics::from_horizontal_fov(SIZE.0 as u32, SIZE.1 as u32, 60_f64.to_radians());
    let (mount, robot) = (Mount::tilted(0.6, 6_f64.to_radians()), Pose2::new(3.0, 0.0, 0.0));
    let rendered = rendered(robot, intrinsics, mount);
    let pixels = std::fs::read(peers().join("vertical_edges.raw")).unwrap_or_else(|_| rendered.clone());
    let image = ImageView::new(&pixels, SIZE.0, SIZE.1, SIZE.0).unwrap();
    let mut expected = BitImage::new(SIZE.0, SIZE.1);
    for u in [30.0, 61.0, 95.0, 140.0, 171.0, 200.0, 228.0] {
        expected.draw_line([u, 40.0].into(), [u + 2.0, 210.0].into());
    }
    let (mut operator, mut seen, mut difference) =
        (VerticalEdges::default(), BitImage::default(), EdgeDifference::default());
    let regions = Regions::new(SIZE.0, 5);
    criterion.bench_function("vertical edges and difference in five regions 256x240", |b| {
        b.iter(|| {
            operator.edges(black_box(image), 20, &mut seen);
            difference.compare(&seen, &expected, 2, &regions);
            difference.max_count()
        });
    });

    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/maps");
    let map = WireFrame::read(&configs.join("hallway.toml")).unwrap();
    let place =
        ThresholdTable::read(&configs.join("hallway-thresholds.toml")).unwrap().at(&robot, 1.0).unwrap();
    let rules = DetectorRules::for_size(SIZE.0 as u32, SIZE.1 as u32);
    let mut detector = Detector::new(Pinhole::ideal(intrinsics), mount, map, rules);
    let image = ImageView::new(&rendered, SIZE.0, SIZE.1, SIZE.0).unwrap();
    criterion.bench_function("detector on the hallway 256x240", |b| {
        b.iter(|| detector.detect(black_box(image), &robot, 1e-3, &place).map(<[_]>::len));
    });
}

criterion_group!(all, benches);
criterion_main!(all);
