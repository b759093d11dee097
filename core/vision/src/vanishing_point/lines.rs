//! Selection of the segments that may run along the corridor.

use crate::segments::Segment;
use nalgebra::{Vector2, Vector3};

use yamabico_geometry::camera::Intrinsics;

/// Segment as an infinite line that votes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VotingLine {
    /// Unit normal of the line normal . p = rho.
    pub normal: Vector2<f64>,
    /// Signed distance of the line from the origin, px.
    pub rho: f64,
    /// Midpoint of the segment, px.
    pub midpoint: Vector2<f64>,
    /// Length of the segment, px.
    pub length: f64,
    /// Index of the segment.
    pub segment: usize,
}

impl VotingLine {
    /// Creates the voting line of the segment with index `segment`.
    #[must_use]
    pub fn new(segment: usize, from: &Segment) -> Self {
        Self { normal: from.normal, rho: from.rho, midpoint: from.midpoint(), length: from.length, segment }
    }

    /// Unit vector along the line, a quarter turn before its normal.
    #[must_use]
    pub fn direction(&self) -> Vector2<f64> {
        Vector2::new(self.normal.y, -self.normal.x)
    }

    /// Endpoints of the segment, px.
    #[must_use]
    pub fn ends(&self) -> [Vector2<f64>; 2] {
        let half = 0.5 * self.length * self.direction();
        [self.midpoint - half, self.midpoint + half]
    }

    /// Returns true if `point` projects between the endpoints. The image of a straight edge never contains its own
    /// vanishing point, so such a line does not lead to `point`.
    pub(crate) fn straddles(&self, point: Vector2<f64>) -> bool {
        let from_middle = point - self.midpoint;
        let along = self.normal.x * from_middle.y - self.normal.y * from_middle.x;
        along.abs() < 0.5 * self.length
    }
}

/// Criteria for excluding segments from the vote.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prefilter {
    /// Unit vector of gravity in the optical frame.
    pub down: Vector3<f64>,
    /// Minimum angle from the image of the vertical, rad.
    pub vertical_rad: f64,
    /// Minimum angle from the horizontal, rad.
    pub horizontal_rad: f64,
    /// Predicted vanishing point: near-horizontal segments are admitted if their line passes within `keep_px` of it.
    pub predicted: Option<Vector2<f64>>,
    pub keep_px: f64,
    /// Minimum length, px.
    pub min_length_px: f64,
    pub max_lines: usize,
}

impl Prefilter {
    /// Fills `lines` with the admitted segments, in their order, at max_lines `max_lines`.
    pub(super) fn select(&self, segments: &[Segment], camera: &Intrinsics, lines: &mut Vec<VotingLine>) {
        lines.clear();
        let voters = segments.iter().enumerate().filter(|(_, segment)| self.admits(segment, camera));
        lines.extend(voters.map(|(index, segment)| VotingLine::new(index, segment)).take(self.max_lines));
    }

    fn admits(&self, segment: &Segment, camera: &Intrinsics) -> bool {
        let sane =
            segment.length.is_finite() && segment.rho.is_finite() && segment.length >= self.min_length_px;
        let vertical = image_of_down(self.down, segment.midpoint(), camera);
        let direction = segment.direction();
        let sine = (direction.x * vertical.y - direction.y * vertical.x).abs();
        let cosine = direction.dot(&vertical).abs();
        let is_vertical = sine < self.vertical_rad.sin();
        let is_horizontal = cosine < self.horizontal_rad.sin();
        let is_predicted = self.predicted.is_some_and(|at| segment.distance(at).abs() <= self.keep_px);
        sane && !is_vertical && (!is_horizontal || is_predicted)
    }
}

/// Unit direction, in the image, of a vertical line through `point`.
pub(super) fn image_of_down(down: Vector3<f64>, point: Vector2<f64>, camera: &Intrinsics) -> Vector2<f64> {
    // The vanishing point of the vertical is K down; homogeneous, as it may be at infinity.
    let towards = Vector2::new(
        camera.fx * down.x + (camera.cx - point.x) * down.z,
        camera.fy * down.y + (camera.cy - point.y) * down.z,
    );
    towards.try_normalize(1e-12).unwrap_or_else(Vector2::y)
}
