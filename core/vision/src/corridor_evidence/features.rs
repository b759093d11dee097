//! Evidence for a hypothesis: its features.

use super::picture::{Picture, WIDTH};
use super::search::Hypothesis;
use crate::segments::Segment;
use crate::vanishing_point::VotingLine;
use nalgebra::Vector2;

/// Length per quadrant that counts as full support, px.
const QUADRANT_PX: f64 = 0.1 * WIDTH;
/// Length added to the total length, px, so that a few segments alone are weak evidence.
const FEW_SEGMENTS_PX: f64 = 0.3 * WIDTH;
/// Gradient from which on an edge is clear, gray levels: edges of walls and floors, not the grain of a floor.
const CLEAR_GRADIENT: f64 = 40.0;
/// Length of clear edges added to their total, px.
const FEW_CLEAR_PX: f64 = 100.0;
/// Minimum angle between two competing hypotheses, rad.
const APART_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Maximum margin.
const MAX_MARGIN: f64 = 4.0;

/// Features of one hypothesis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Share of the voters' length that points at the hypothesis, 0 to 1.
    pub support_share: f64,
    /// Support in the four quadrants around the point, each at most 1, summed: a corridor has two walls, a floor and a ceiling.
    pub quadrants: f64,
    /// Distance of the point from the image, in half widths and heights; 0 inside.
    pub outside: f64,
    /// Logarithm of the ratio of its score to that of the best competitor, at most 4.
    pub margin: f64,
    /// Logarithm of 1 plus the negative decimal logarithm of the number of false alarms; 0 if chance explains the point.
    pub not_by_chance: f64,
    /// Share of the image's width that the foot line of a wall ahead covers, 0 to 1.
    pub foot: f64,
    /// Share of the voters' length that points at the hypothesis, each weighted by its contrast, 0 to 1: few long edges of walls
    /// count for more than much texture.
    pub clear_share: f64,
}

impl Features {
    /// Computes the features of `chosen` but for its clear edges, with the supports `kappas` of the `voters`; `others` are the other
    /// hypotheses of the same image.
    pub fn of<'a>(
        chosen: &Hypothesis,
        others: impl Iterator<Item = &'a Hypothesis>,
        voters: &[VotingLine],
        kappas: &[f64],
        log10_false_alarms: f64,
        foot_coverage: f64,
        picture: &Picture,
    ) -> Self {
        let point = chosen.point;
        let (mut supporting, mut total, mut quadrants) = (0.0, 0.0, [0.0; 4]);
        for (line, kappa) in voters.iter().zip(kappas) {
            let length = kappa * line.length;
            supporting += length;
            total += line.length;
            let offset = line.midpoint - point;
            if offset.x != 0.0 && offset.y != 0.0 {
                quadrants[usize::from(offset.x > 0.0) + 2 * usize::from(offset.y < 0.0)] += length;
            }
        }
        Self {
            support_share: supporting / (total + FEW_SEGMENTS_PX),
            quadrants: quadrants.iter().map(|length| (length / QUADRANT_PX).min(1.0)).sum(),
            outside: outside(point, picture),
            margin: margin(chosen, others, picture),
            not_by_chance: (-log10_false_alarms).max(0.0).ln_1p(),
            foot: foot_coverage,
            clear_share: 0.0,
        }
    }

    /// Adds the share of clear edges. `segments` are those that `voters` refer to.
    #[must_use]
    pub fn with_clear_edges(self, voters: &[VotingLine], kappas: &[f64], segments: &[Segment]) -> Self {
        let (mut supporting, mut total) = (0.0, 0.0);
        for (line, kappa) in voters.iter().zip(kappas) {
            let gradient = segments.get(line.segment).map_or(0.0, |segment| segment.mean_gradient);
            let weight = line.length * (gradient / CLEAR_GRADIENT).min(1.0);
            supporting += kappa * weight;
            total += weight;
        }
        Self { clear_share: supporting / (total + FEW_CLEAR_PX), ..self }
    }
}

fn outside(point: Vector2<f64>, picture: &Picture) -> f64 {
    let half = 0.5 * Vector2::new(WIDTH, picture.height);
    ((point - half).abs().component_div(&half).max() - 1.0).max(0.0)
}

fn margin<'a>(chosen: &Hypothesis, others: impl Iterator<Item = &'a Hypothesis>, picture: &Picture) -> f64 {
    let angles =
        |point: Vector2<f64>| Vector2::new(picture.heading_of(point.x), picture.depression_of(point.y));
    let at = angles(chosen.point);
    let second = others
        .filter(|other| (angles(other.point) - at).abs().sum() > APART_RAD)
        .fold(1e-3, |best: f64, other| best.max(other.score));
    if second > 1e-2 { (chosen.score.max(1e-3) / second).ln().min(MAX_MARGIN) } else { MAX_MARGIN }
}
