//! Vanishing point search on synthetic segments: in view, far outside, predicted, and every error.

use nalgebra::{Vector2, Vector3};
use yamabico_geometry::camera::Intrinsics;
use yamabico_vision::segments::Segment;
use yamabico_vision::vanishing_point::{
    Prediction, VanishingPointConfig, VanishingPointError, VanishingPointFinder,
};

fn camera() -> Intrinsics {
    Intrinsics { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, width: 640, height: 480 }
}

fn finder() -> VanishingPointFinder {
    VanishingPointFinder::new(VanishingPointConfig::default())
}

fn between(from: [f64; 2], to: [f64; 2]) -> Segment {
    Segment::between(Vector2::from(from), Vector2::from(to), 0.5).unwrap()
}

/// Returns segments on rays from `vp`, 80 px to 200 px away, at these angles (degrees).
fn star(vp: [f64; 2], degrees: &[f64]) -> Vec<Segment> {
    let at =
        |angle: f64, r: f64| [vp[0] + r * angle.to_radians().cos(), vp[1] + r * angle.to_radians().sin()];
    degrees.iter().map(|&angle| between(at(angle, 80.0), at(angle, 200.0))).collect()
}

/// Returns the image of the line from `start` along `direction`, 0 m to `reach` m, in the optical frame.
fn image_of(start: [f64; 3], direction: [f64; 3], reach: f64) -> Segment {
    let camera = camera();
    let at = |t: f64| {
        let p = Vector3::from(start) + Vector3::from(direction) * t;
        camera.pixel_from_normalized(p.xy() / p.z)
    };
    Segment::between(at(0.0), at(reach), 0.5).unwrap()
}

#[test]
fn finds_the_meeting_point_among_clutter() {
    let vp = [350.25, 220.5];
    let mut segments = star(vp, &[25.0, 40.0, 140.0, 155.0, 205.0, 330.0]);
    let clutter = [[40.0, 60.0, 90.0, 110.0], [600.0, 90.0, 560.0, 170.0], [100.0, 400.0, 180.0, 440.0]];
    segments.extend(clutter.map(|[a, b, c, d]| between([a, b], [c, d])));
    // Vertical segments do not vote.
    segments.extend((0..5).map(|i| between([100.0 * f64::from(i), 50.0], [100.0 * f64::from(i), 300.0])));
    let mut finder = finder();
    let found = finder.find(&segments, &camera(), None).unwrap();
    assert!((found.pixel - Vector2::from(vp)).norm() < 1e-3, "{}", found.pixel);
    assert_eq!(found.inliers, [0, 1, 2, 3, 4, 5]);
    assert!(!found.at_infinity && found.spread_rad > 1.0 && found.sigma_px() < 3.0);
    let expected = Vector3::new((vp[0] - 319.5) / 500.0, (vp[1] - 239.5) / 500.0, 1.0).normalize();
    assert!((found.direction - expected).norm() < 1e-5);
}

#[test]
fn an_edge_that_straddles_the_point_does_not_count() {
    let vp = [320.0, 230.0];
    let mut segments = star(vp, &[30.0, 150.0, 215.0, 320.0]);
    segments.push(between([220.0, 180.0], [420.0, 280.0]));
    let mut finder = finder();
    assert_eq!(finder.find(&segments, &camera(), None).unwrap().inliers, [0, 1, 2, 3]);
}

#[test]
fn a_wall_ahead_gives_the_axis_as_a_direction() {
    // The camera points 80 degrees to the left of the axis, which points right and slightly ahead.
    let axis = Vector3::new(80_f64.to_radians().sin(), 0.0, 80_f64.to_radians().cos());
    let rows = [-1.0, -0.6, -0.3, 0.4, 0.8, 1.1];
    let segments: Vec<_> = rows.map(|y| image_of([-1.0, y, 2.0], axis.into(), 2.0)).into();
    let mut finder = finder();
    let found = finder.find(&segments, &camera(), None).unwrap();
    assert!(found.at_infinity);
    assert!(found.direction.angle(&axis) < 0.01, "{}", found.direction);
    assert_eq!(found.inliers.len(), rows.len());
    assert!(found.pixel.x.is_finite() && found.covariance.iter().all(|c| c.is_finite()));
    // A prediction may select the opposite direction.
    let back = Prediction { direction: -axis, sigma_rad: 0.1 };
    assert!(finder.find(&segments, &camera(), Some(back)).unwrap().direction.angle(&-axis) < 0.01);
}

#[test]
fn two_equal_points_are_ambiguous_until_one_is_predicted() {
    let (left, right) = ([160.0, 239.5], [480.0, 239.5]);
    let mut segments = star(left, &[40.0, 65.0, 115.0, 140.0]);
    segments.extend(star(right, &[40.0, 65.0, 115.0, 140.0]));
    let camera = camera();
    let mut finder = finder();
    assert_eq!(finder.find(&segments, &camera, None), Err(VanishingPointError::Ambiguous));
    for expected in [left, right] {
        let prediction =
            Prediction::at_pixel(Vector2::new(expected[0] + 9.0, expected[1] - 5.0), 20.0, &camera);
        let found = finder.find(&segments, &camera, Some(prediction)).unwrap();
        assert!((found.pixel - Vector2::from(expected)).norm() < 0.1, "{}", found.pixel);
    }
}

#[test]
fn a_prediction_lets_two_lines_be_enough() {
    let vp = [300.0, 240.0];
    let segments = star(vp, &[30.0, 150.0]);
    let camera = camera();
    let mut finder = finder();
    assert_eq!(finder.find(&segments, &camera, None), Err(VanishingPointError::NoVanishingPoint));
    let prediction = Prediction::at_pixel(Vector2::new(305.0, 238.0), 10.0, &camera);
    assert!(finder.find(&segments, &camera, Some(prediction)).is_ok());
}

#[test]
fn failures_have_names() {
    let mut finder = finder();
    let mut failure = |segments: &[Segment]| finder.find(segments, &camera(), None).err();
    assert_eq!(failure(&[]), Some(VanishingPointError::TooFewSegments { found: 0 }));
    let parallel: Vec<_> =
        (0..6).map(|i| between([80.0 * f64::from(i), 100.0], [80.0 * f64::from(i) + 60.0, 160.0])).collect();
    assert!(matches!(
        failure(&parallel),
        Some(VanishingPointError::NoVanishingPoint | VanishingPointError::Degenerate)
    ));
    // Pieces of one edge: a single plane, in which every direction lies.
    let on_edge = |u: f64| [u, 300.0 + 0.12 * u];
    let one_edge: Vec<_> =
        [20.0, 240.0, 460.0].into_iter().map(|u| between(on_edge(u), on_edge(u + 120.0))).collect();
    assert!(failure(&one_edge).is_some());
    let mut broken = star([320.0, 240.0], &[30.0, 60.0, 150.0]);
    for segment in &mut broken {
        segment.rho = f64::NAN;
    }
    assert_eq!(failure(&broken), Some(VanishingPointError::TooFewSegments { found: 0 }));
}
