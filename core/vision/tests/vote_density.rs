//! Vote density of Kweon et al. (1991) at a pixel: reference implementation for testing the fast search.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use nalgebra::Vector2;
use yamabico_vision::vanishing_point::VotingLine;

/// Width of a line's vote.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoteKernel {
    /// Product of standard deviation and segment length, px^2: longer edges vote more sharply.
    pub sigma_times_length_px2: f64,
    /// Minimum standard deviation, px.
    pub sigma_min_px: f64,
    /// Maximum standard deviation, px.
    pub sigma_max_px: f64,
}

impl Default for VoteKernel {
    /// For an image 640 px wide; `sigma_times_length_px2` scales with the squared width.
    fn default() -> Self {
        Self { sigma_times_length_px2: 100.0, sigma_min_px: 0.5, sigma_max_px: 10.0 }
    }
}

/// Sum over the lines of the normal density of `point`'s distance from each, 1/px. Edges vote along their infinite
/// lines. Source: Kweon et al. (1991), vote of an edge.
pub fn vote_density(lines: &[VotingLine], point: Vector2<f64>, kernel: &VoteKernel) -> f64 {
    lines
        .iter()
        .map(|line| {
            let sigma =
                (kernel.sigma_times_length_px2 / line.length).clamp(kernel.sigma_min_px, kernel.sigma_max_px);
            let d = (line.normal.dot(&point) - line.rho) / sigma;
            (-0.5 * d * d).exp() / (TAU.sqrt() * sigma)
        })
        .sum()
}

/// Pixel of the window with the largest vote density, and that density; of equal ones the topmost, then the leftmost.
/// `None` for an empty window.
pub fn vote_peak(
    lines: &[VotingLine],
    columns: RangeInclusive<i32>,
    rows: RangeInclusive<i32>,
    kernel: &VoteKernel,
) -> Option<(Vector2<i32>, f64)> {
    let mut best: Option<(Vector2<i32>, f64)> = None;
    for v in rows {
        for u in columns.clone() {
            let value = vote_density(lines, Vector2::new(f64::from(u), f64::from(v)), kernel);
            if best.is_none_or(|(_, highest)| value > highest) {
                best = Some((Vector2::new(u, v), value));
            }
        }
    }
    best
}
