//! Processing does not allocate after the first frame.

use nalgebra::Vector2;
use yamabico_core::testing::{Allocations, allocations};
use yamabico_geometry::camera::{Calibration, Intrinsics, Mount};
use yamabico_geometry::image::{GrayImage, ImageView, RgbView};
use yamabico_vision::corridor_evidence::{self, Coefficients, CorridorJudge, RowPrior};
use yamabico_vision::floor_appearance::{self, FloorAppearance, FloorPlace};
use yamabico_vision::gradient::{Gradient, Scharr};
use yamabico_vision::median::Median3;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{Prediction, VanishingPointConfig, VanishingPointFinder};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// Renders two walls, floor and ceiling with edges that meet at `vp`.
fn corridor(vp: Vector2<f64>) -> Vec<u8> {
    let shade = |u: usize, v: usize| {
        let (du, dv) = (u as f64 - vp.x, v as f64 - vp.y);
        let stripe = if (dv.atan2(du) * 9.0).sin() > 0.0 { 25 } else { 0 };
        let base = if dv.abs() > du.abs() {
            if dv > 0.0 { 90 } else { 200 }
        } else if du > 0.0 {
            130
        } else {
            160
        };
        base + stripe
    };
    (0..WIDTH * HEIGHT).map(|i| shade(i % WIDTH, i / WIDTH)).collect()
}

#[test]
fn frames_after_the_first_do_not_allocate() {
    let images: Vec<_> = [170.3, 120.9, 150.2].map(|u| corridor(Vector2::new(u, 115.6))).into();
    let blank = vec![128; WIDTH * HEIGHT];
    let rgb: Vec<u8> = images[0].iter().flat_map(|&gray| [gray; 3]).collect();
    let camera = Intrinsics::from_horizontal_fov(WIDTH as u32, HEIGHT as u32, 1.0);
    let prediction = Prediction::at_pixel(Vector2::new(150.0, 115.0), 30.0, &camera);
    let mut detector = SegmentDetector::new(SegmentConfig::default());
    let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
    let picture = corridor_evidence::Picture::of(&camera);
    let prior = RowPrior::of_mount(&picture, &Mount::level(0.5), Calibration::Measured, None);
    let mut judge = CorridorJudge::new(Coefficients::SEGMENTS_2, 0.5);
    let mut members = Vec::new();
    let (mut median, mut scharr) = (Median3::default(), Scharr::default());
    let (mut filtered, mut gray, mut gradient) =
        (GrayImage::default(), GrayImage::default(), Gradient::default());
    let mut look = |data: &[u8]| {
        let image = ImageView::new(data, WIDTH, HEIGHT, WIDTH).unwrap();
        gray.copy_from_rgb8(&rgb, WIDTH, HEIGHT, 3 * WIDTH).unwrap();
        median.filter(image, &mut filtered);
        scharr.smoothed_gradient(image, &mut gradient);
        let segments = detector.detect(image).ok()?;
        assert!(finder.find(segments, &camera, None).is_ok());
        let sighting = judge.look(segments, &picture, &prior, None);
        judge.members(sighting.hypothesis?.point, &mut members);
        finder.find(segments, &camera, Some(prediction)).ok().map(|found| found.pixel)
    };
    for data in &images {
        assert!(look(data).is_some());
    }
    let frames = images.iter().chain([&blank]).chain(&images);
    let (found, asked) = allocations(|| frames.filter(|data| look(data).is_some()).count());
    assert_eq!(found, 2 * images.len());
    assert_eq!(asked, Allocations::default(), "allocations in seven frames");
}

#[test]
fn votes_by_the_floor_s_look_do_not_allocate_after_the_first_image() {
    let mut images: Vec<Vec<u8>> = Vec::new();
    for level in [90_u8, 120, 60, 200] {
        let shade = |u: usize, v: usize| match (u / 20 + v / 30) % 3 {
            _ if v < 110 => [40, 60, level],
            0 => [level, level / 2, 90],
            _ => [130, 130, 120],
        };
        images.push((0..WIDTH * HEIGHT).flat_map(|i| shade(i % WIDTH, i / WIDTH)).collect());
    }
    let mut appearance = FloorAppearance::default();
    let mut look = |data: &[u8]| {
        let picture = floor_appearance::Picture::Color(RgbView::new(data, WIDTH, HEIGHT, 3 * WIDTH).unwrap());
        appearance.observe(picture, &FloorPlace::UNKNOWN_CAMERA).map_or(0, |votes| votes.log_odds().len())
    };
    let count = look(&images[0]);
    let (votes, asked) = allocations(|| images.iter().map(|image| look(image)).sum::<usize>());
    assert_eq!((votes, asked), (4 * count, Allocations::default()));
    assert!(count > 500);
}
