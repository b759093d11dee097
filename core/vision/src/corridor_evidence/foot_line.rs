//! Foot line of a wall ahead: a chain of nearly horizontal segments below the horizon.

use super::picture::{Picture, WIDTH};
use super::scene_lines::{MIN_LENGTH_PX, RESERVED};
use crate::segments::Segment;
use nalgebra::Vector2;

/// Maximum angle of a segment from the image's horizontal, rad.
const MAX_SLOPE_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Minimum depth of a midpoint below the horizon, heights of the image.
const MIN_DEPTH: f64 = 0.05;
/// Number of segments from which chains are tried, longest first.
const LEADS: usize = 12;
/// Maximum number of links to each side.
const LINKS: usize = 30;
/// Maximum overlap and gap between two links, px.
const OVERLAP_PX: f64 = 5.0;
const GAP_PX: f64 = 0.08 * WIDTH;
/// Maximum distance of a link from the continuation of the one before, px.
const OFF_PX: f64 = 6.0;
/// Maximum angle between two links, rad: foot lines are bent by lenses.
const BEND_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// Minimum gain of a link, px.
const GAIN_PX: f64 = 3.0;

/// Chain of nearly horizontal segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootLine {
    /// Covered share of the image's width, 0 to 1.
    pub coverage: f64,
    /// Row of the middle of its longest segment, pixels of an image 640 px wide.
    pub row: f64,
    /// Columns of its ends, px.
    pub columns: [f64; 2],
}

impl FootLine {
    /// Share of the middle half of the image that the line spans, 0 to 1.
    #[must_use]
    pub fn central_share(&self) -> f64 {
        let (from, to) = (self.columns[0].max(0.25 * WIDTH), self.columns[1].min(0.75 * WIDTH));
        (to - from).max(0.0) / (0.5 * WIDTH)
    }
}

/// Wall that closes the corridor ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallAhead {
    /// Distance to its foot line, camera heights above the floor.
    pub range_heights: f64,
    /// Rows between the horizon and the foot line, px; its growth gives the time to contact.
    pub depth_px: f64,
}

impl WallAhead {
    /// Minimum coverage, share of the middle, and depth below the horizon (heights of the image) of its foot line.
    const MIN_COVERAGE: f64 = 0.45;
    const MIN_CENTRAL: f64 = 0.6;
    const MIN_DEPTH: f64 = 0.08;

    /// Returns the wall whose foot is `foot`, for a horizon at `row` (px); `None` if the line does not cross the corridor.
    #[must_use]
    pub fn of(foot: &FootLine, row: f64, picture: &Picture) -> Option<Self> {
        let depth_px = foot.row - row;
        let is_across = foot.coverage >= Self::MIN_COVERAGE
            && foot.central_share() >= Self::MIN_CENTRAL
            && depth_px >= Self::MIN_DEPTH * picture.height;
        is_across.then(|| Self { range_heights: picture.focal / depth_px, depth_px })
    }
}

/// Piece of a chain, from left to right.
#[derive(Clone, Copy, Debug)]
struct Link {
    ends: [Vector2<f64>; 2],
    /// Descent to the right, rad.
    angle: f64,
}

impl Link {
    fn extent(&self) -> f64 {
        self.ends[1].x - self.ends[0].x
    }
}

/// Finds foot lines. Reuses its buffer.
#[derive(Clone, Debug, Default)]
pub struct FootLineFinder {
    links: Vec<(Link, usize)>,
}

impl FootLineFinder {
    /// Finds the chain below `row` (pixels of an image 640 px wide) that covers most of the width; `None` if there is no
    /// nearly horizontal segment.
    pub fn find(&mut self, segments: &[Segment], picture: &Picture, row: f64) -> Option<FootLine> {
        self.links.clear();
        self.links.reserve(RESERVED);
        let lowest = row + MIN_DEPTH * picture.height;
        let links = segments.iter().enumerate().filter_map(|(i, s)| Some((link(s, picture, lowest)?, i)));
        self.links.extend(links);
        self.links.sort_unstable_by(|(a, i), (b, j)| b.extent().total_cmp(&a.extent()).then(i.cmp(j)));
        let mut best: Option<FootLine> = None;
        for index in 0..self.links.len().min(LEADS) {
            let line = self.chain(index);
            if best.is_none_or(|best| line.coverage > best.coverage) {
                best = Some(line);
            }
        }
        best
    }

    fn chain(&self, lead: usize) -> FootLine {
        let lead = self.links[lead].0;
        let mut covered = lead.extent();
        let mut columns = [0.0; 2];
        for side in [1, 0] {
            let outward = if side == 1 { 1.0 } else { -1.0 };
            let mut link = lead;
            for _ in 0..LINKS {
                let Some(next) = self.next(&link, side, outward) else { break };
                let gap = (next.ends[1 - side].x - link.ends[side].x) * outward;
                covered += (next.ends[side].x - link.ends[side].x).abs() - gap.max(0.0);
                link = next;
            }
            columns[side] = link.ends[side].x;
        }
        let row = 0.5 * (lead.ends[0].y + lead.ends[1].y);
        FootLine { coverage: (covered / WIDTH).min(1.0), row, columns }
    }

    /// Returns the link that continues `link` best on one side.
    fn next(&self, link: &Link, side: usize, outward: f64) -> Option<Link> {
        let end = link.ends[side];
        let slope = link.angle.tan();
        let mut best = (f64::INFINITY, None);
        for (candidate, _) in &self.links {
            let near = candidate.ends[1 - side];
            let gap = (near.x - end.x) * outward;
            let off = (near.y - (end.y + slope * (near.x - end.x))).abs();
            let continues = (-OVERLAP_PX..=GAP_PX).contains(&gap)
                && off <= OFF_PX
                && (candidate.angle - link.angle).abs() <= BEND_RAD
                && (candidate.ends[side].x - end.x) * outward > GAIN_PX;
            if continues && gap.abs() + off < best.0 {
                best = (gap.abs() + off, Some(*candidate));
            }
        }
        best.1
    }
}

/// Returns the segment as a link, if it is nearly horizontal and its middle lies below the row `lowest`.
fn link(segment: &Segment, picture: &Picture, lowest: f64) -> Option<Link> {
    let (a, b) = (segment.p0 * picture.scale, segment.p1 * picture.scale);
    let ends = if a.x > b.x { [b, a] } else { [a, b] };
    let along = ends[1] - ends[0];
    let angle = (along.y / along.x.max(1e-9)).atan();
    let is_link = segment.length * picture.scale >= MIN_LENGTH_PX
        && angle.abs() <= MAX_SLOPE_RAD
        && 0.5 * (a.y + b.y) > lowest;
    is_link.then_some(Link { ends, angle })
}
