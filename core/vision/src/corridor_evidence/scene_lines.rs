//! Segments of one image by their direction.

use super::picture::Picture;
use crate::segments::Segment;
use crate::vanishing_point::VotingLine;
use nalgebra::Vector2;

/// Minimum length of a segment, px.
pub const MIN_LENGTH_PX: f64 = 15.0;
/// Maximum number of voters.
pub const MAX_VOTERS: usize = 150;
/// Number of segments that buffers have room for from the first image on.
pub(super) const RESERVED: usize = 600;
/// Maximum angle of a vertical segment from the plumb direction, rad.
pub const VERTICAL_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Maximum angle of a horizontal segment from the perpendicular of the plumb direction, rad.
pub const HORIZONTAL_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Segments of one image, scaled to a width of 640 px. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct SceneLines {
    all: Vec<VotingLine>,
    voters: Vec<VotingLine>,
    verticals: usize,
    horizontals: usize,
}

impl SceneLines {
    /// Takes the segments of an image, in pixels of the camera. They are classified by [`SceneLines::classify`].
    pub fn take(&mut self, segments: &[Segment], picture: &Picture) {
        let scale = picture.scale;
        for lines in [&mut self.all, &mut self.voters] {
            lines.clear();
            lines.reserve(RESERVED);
        }
        let lines = segments.iter().enumerate().map(|(index, segment)| {
            let line = VotingLine::new(index, segment);
            let (midpoint, length) = (line.midpoint * scale, line.length * scale);
            VotingLine { rho: line.rho * scale, midpoint, length, ..line }
        });
        let is_usable = |line: &VotingLine| line.length.is_finite() && line.length >= MIN_LENGTH_PX;
        self.all.extend(lines.filter(|line| is_usable(line) && line.rho.is_finite()));
    }

    /// Selects the voters for an image in which plumb lines lean by `roll` (rad, du/dv): the longest of all that are
    /// neither vertical nor horizontal, longest first.
    pub fn classify(&mut self, roll: f64) {
        let plumb = Vector2::new(roll.sin(), roll.cos());
        self.voters.clear();
        (self.verticals, self.horizontals) = (0, 0);
        for line in &self.all {
            let direction = line.direction();
            let sine = (direction.x * plumb.y - direction.y * plumb.x).abs();
            if sine < VERTICAL_RAD.sin() {
                self.verticals += 1;
            } else if direction.dot(&plumb).abs() < HORIZONTAL_RAD.sin() {
                self.horizontals += 1;
            } else {
                self.voters.push(*line);
            }
        }
        // Equal lengths keep their order; a stable sort would allocate.
        self.voters.sort_unstable_by(|a, b| b.length.total_cmp(&a.length).then(a.segment.cmp(&b.segment)));
        self.voters.truncate(MAX_VOTERS);
    }

    /// All segments of at least [`MIN_LENGTH_PX`], in the order of the image's segments.
    #[must_use]
    pub fn all(&self) -> &[VotingLine] {
        &self.all
    }

    /// Segments that may point at the vanishing point, longest first.
    #[must_use]
    pub fn voters(&self) -> &[VotingLine] {
        &self.voters
    }

    /// Number of vertical segments.
    #[must_use]
    pub fn verticals(&self) -> usize {
        self.verticals
    }

    /// Number of horizontal segments.
    #[must_use]
    pub fn horizontals(&self) -> usize {
        self.horizontals
    }
}
