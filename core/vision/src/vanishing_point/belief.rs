//! The belief of Kweon et al. (1991) at every pixel: the reference that the fast search is held against.

use super::lines::VotingLine;
use nalgebra::Vector2;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// How wide a line votes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Standard deviation times length, px^2: longer edges vote more sharply.
    pub sigma_times_length_px2: f64,
    /// Smallest standard deviation, px.
    pub sigma_min_px: f64,
    /// Largest standard deviation, px.
    pub sigma_max_px: f64,
}

impl Default for Belief {
    /// For an image 640 px wide; the first number scales with the width squared.
    fn default() -> Self {
        Self { sigma_times_length_px2: 100.0, sigma_min_px: 0.5, sigma_max_px: 10.0 }
    }
}

/// Sum over the lines of the normal density at `point`'s distance from each, 1/px. Source: Kweon et al. (1991), the
/// vote of an edge; edges vote along their endless lines.
#[must_use]
pub fn belief_at(lines: &[VotingLine], point: Vector2<f64>, belief: &Belief) -> f64 {
    lines
        .iter()
        .map(|line| {
            let sigma =
                (belief.sigma_times_length_px2 / line.length).clamp(belief.sigma_min_px, belief.sigma_max_px);
            let d = (line.normal.dot(&point) - line.rho) / sigma;
            (-0.5 * d * d).exp() / (TAU.sqrt() * sigma)
        })
        .sum()
}

/// The pixel of the window with the largest belief, and that belief; of equal ones the topmost, then leftmost. `None` for
/// an empty window. Takes time for every pixel and every line: for reference, not for frames.
#[must_use]
pub fn belief_peak(
    lines: &[VotingLine],
    columns: RangeInclusive<i32>,
    rows: RangeInclusive<i32>,
    belief: &Belief,
) -> Option<(Vector2<i32>, f64)> {
    let mut best: Option<(Vector2<i32>, f64)> = None;
    for v in rows {
        for u in columns.clone() {
            let value = belief_at(lines, Vector2::new(f64::from(u), f64::from(v)), belief);
            if best.is_none_or(|(_, most)| value > most) {
                best = Some((Vector2::new(u, v), value));
            }
        }
    }
    best
}
