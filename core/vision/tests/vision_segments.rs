//! Segment detector on synthetic images: detection, rejection, and adaptation to low light.

use yamabico_geometry::image::{GrayImage, ImageView};
use yamabico_vision::segments::{Polarity, Segment, SegmentConfig, SegmentDetector, SegmentError};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// Renders an image from the gray level of each pixel.
fn render(level: impl Fn(f64, f64) -> f64) -> GrayImage {
    let mut image = GrayImage::new(WIDTH, HEIGHT);
    for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
        *pixel = level((i % WIDTH) as f64, (i / WIDTH) as f64).round() as u8;
    }
    image
}

/// 1 inside the box, 0 outside, anti-aliased.
fn inside(u: f64, v: f64, left: f64, top: f64, right: f64, bottom: f64) -> f64 {
    let ramp = |x: f64| (x + 0.5).clamp(0.0, 1.0);
    ramp(u - left) * ramp(right - u) * ramp(v - top) * ramp(bottom - v)
}

fn detector() -> SegmentDetector {
    SegmentDetector::new(SegmentConfig::default())
}

fn is_horizontal(segment: &Segment) -> bool {
    segment.direction().x.abs() > 0.999
}

#[test]
fn a_box_has_four_sides_that_are_brighter_inside() {
    let image = render(|u, v| 60.0 + 120.0 * inside(u, v, 80.3, 60.7, 240.2, 180.4));
    let mut detector = detector();
    let segments = detector.detect(image.view().unwrap()).unwrap();
    assert_eq!(segments.len(), 4);
    assert!(segments.is_sorted_by(|a, b| a.length >= b.length), "longest first");
    for segment in segments {
        let (expected, along) = if is_horizontal(segment) { (159.9, 0) } else { (119.7, 1) };
        assert!((segment.length - expected).abs() < 8.0, "{segment:?}");
        let middle = segment.midpoint();
        let sides = if along == 0 { [60.7, 180.4] } else { [80.3, 240.2] };
        let across = if along == 0 { middle.y } else { middle.x };
        assert!(sides.iter().any(|side| (across - side).abs() < 0.1), "{segment:?}");
        let center_is_along_normal = segment.distance([160.0, 120.0].into()) > 0.0;
        assert_eq!(segment.polarity == Polarity::BrighterAlongNormal, center_is_along_normal);
        // A step of 120, smoothed: 0.63 of it.
        assert!((70.0..80.0).contains(&segment.mean_gradient), "{}", segment.mean_gradient);
        assert!(segment.sigma_mid < 0.05 && segment.sigma_angle < 0.01);
    }
}

#[test]
fn a_short_gap_is_bridged_and_a_wide_one_is_not() {
    let with_gap = |gap: f64| {
        render(move |u, v| {
            let edge = inside(u, v, 40.0, 120.4, 280.0, 300.0);
            100.0 + 80.0 * edge * (1.0 - inside(u, v, 150.0, 100.0, 150.0 + gap, 300.0))
        })
    };
    let horizontal = |image: &GrayImage| {
        let mut detector = detector();
        let segments = detector.detect(image.view().unwrap()).unwrap();
        segments.iter().filter(|s| is_horizontal(s) && s.midpoint().y < 130.0).count()
    };
    assert_eq!(horizontal(&with_gap(5.0)), 1);
    assert_eq!(horizontal(&with_gap(70.0)), 2);
}

#[test]
fn the_borders_of_glare_are_not_edges_of_the_scene() {
    // A thin mark in a saturated streak, and a box elsewhere.
    let scene = |mark: f64| {
        render(move |u, v| {
            let streak = 150.0 * inside(u, v, 30.0, 20.0, 290.0, 60.0);
            let line = mark * inside(u, v, 40.0, 39.6, 280.0, 40.4);
            (105.0 + streak - line - 60.0 * inside(u, v, 100.0, 120.0, 200.0, 200.0)).clamp(0.0, 255.0)
        })
    };
    let in_streak = |image: &GrayImage| {
        let mut detector = detector();
        let segments = detector.detect(image.view().unwrap()).unwrap();
        segments.iter().filter(|s| (30.0..50.0).contains(&s.midpoint().y) && is_horizontal(s)).count()
    };
    assert_eq!(in_streak(&scene(90.0)), 0);
}

#[test]
fn a_dark_image_lowers_the_thresholds_until_it_is_detected() {
    let dim = render(|u, v| 20.0 + 8.0 * inside(u, v, 80.3, 60.7, 240.2, 180.4));
    let mut detector = detector();
    let mut failed = 0;
    while detector.detect(dim.view().unwrap()).is_err() {
        failed += 1;
        assert!(failed < 12, "never detected");
    }
    assert!(failed > 0 && detector.is_degraded());
    assert_eq!(detector.segments().len(), 4);
    detector.reset();
    assert!(!detector.is_degraded());
    assert!(detector.detect(dim.view().unwrap()).is_err());
}

#[test]
fn images_without_edges_are_rejected() {
    let mut detector = detector();
    for (width, height) in [(1, 1), (2, 2), (3, 40), (40, 3), (WIDTH, HEIGHT)] {
        let data = vec![77; width * height];
        let image = ImageView::new(&data, width, height, width).unwrap();
        assert_eq!(detector.detect(image).err(), Some(SegmentError::TooFewSegments { found: 0 }));
    }
    let wide = vec![0; 70_000];
    let image = ImageView::new(&wide, 70_000, 1, 70_000).unwrap();
    assert_eq!(detector.detect(image).err(), Some(SegmentError::TooWide { width: 70_000 }));
}

#[test]
fn only_the_longest_are_kept() {
    let stripes =
        render(|u, v| if ((v / 6.0) as usize).is_multiple_of(2) && u < 40.0 + v { 200.0 } else { 50.0 });
    let config = SegmentConfig { max_segments: 7, ..SegmentConfig::default() };
    let all = detector().detect(stripes.view().unwrap()).unwrap().len();
    let mut detector = SegmentDetector::new(config);
    let kept = detector.detect(stripes.view().unwrap()).unwrap();
    assert!(all > 20 && kept.len() == 7, "{all}");
    assert!(kept.iter().all(|segment| segment.length > 200.0));
}
