//! Signs of the horizon in one picture of a corridor: its vanishing point, and edges that may be vertical.

use nalgebra::Vector2;

use crate::segments::Segment;

/// Maximum angle of a plumb line from the column direction, rad.
const PLUMB_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Minimum length of a plumb line, as a share of the picture's width.
const MIN_LENGTH_SHARE: f64 = 0.04;
/// Distance of a line from the vanishing point below which it may run along the corridor instead, likewise.
const ALONG_SHARE: f64 = 0.012;

/// Plumb line in a picture, undistorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlumbLine {
    /// Middle, px.
    pub middle: Vector2<f64>,
    /// Columns per row.
    pub slope: f64,
    /// Length, px.
    pub length: f64,
}

/// Lines of one picture of a corridor, undistorted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CorridorSight {
    /// Vanishing point of the corridor, px.
    pub point: Option<Vector2<f64>>,
    /// Edges that may be vertical.
    pub plumb: Vec<PlumbLine>,
}

impl CorridorSight {
    /// Takes from the undistorted segments of a picture, `width` px wide, those that may be plumb lines. Lines towards the corridor's
    /// vanishing point are none, even where they are steep.
    #[must_use]
    pub fn new(point: Option<Vector2<f64>>, segments: &[Segment], width: f64) -> Self {
        let plumb = segments.iter().filter_map(|segment| {
            let direction = segment.direction();
            let slope = direction.x / direction.y;
            let is_steep = slope.is_finite() && slope.atan().abs() < PLUMB_RAD;
            let is_along = point.is_some_and(|point| segment.distance(point).abs() < ALONG_SHARE * width);
            let is_plumb = is_steep && !is_along && segment.length > MIN_LENGTH_SHARE * width;
            is_plumb.then(|| PlumbLine { middle: segment.midpoint(), slope, length: segment.length })
        });
        Self { point, plumb: plumb.collect() }
    }
}
