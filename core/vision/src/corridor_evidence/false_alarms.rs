//! Number of false alarms: how often lines in random directions would meet as well by chance.
//!
//! Desolneux, Moisan and Morel (2000); for vanishing points Lezama et al. (2014). The tail is Hoeffding's bound (1956) for
//! unequal probabilities.

use super::scene_lines::{HORIZONTAL_RAD, VERTICAL_RAD};
use super::support::Support;
use crate::vanishing_point::VotingLine;
use nalgebra::Vector2;
use std::f64::consts::{LN_10, PI};

/// Range of directions of a voter, rad.
const DIRECTIONS_RAD: f64 = PI - 2.0 * VERTICAL_RAD - 2.0 * HORIZONTAL_RAD;
/// Maximum distance of a fragment's ends from the line of its edge, px.
const SAME_EDGE_PX: f64 = 2.0;
/// Maximum angle between a fragment and its edge, rad.
const SAME_EDGE_RAD: f64 = 1.5 * PI / 180.0;

/// Decimal logarithm of the expected number of false alarms of a point at which `aligned` of `edges` edges point, including the
/// two that define it.
/// `probability` is the mean probability that an edge agrees by chance.
#[must_use]
pub fn log10_false_alarms(edges: usize, aligned: usize, probability: f64) -> f64 {
    let (n, k) = (edges as f64, aligned as f64);
    let tests = 0.5 * n * (n - 1.0);
    if edges < 3 || aligned < 3 {
        return tests.max(1.0).log10();
    }
    let p = probability.clamp(1e-9, 1.0 - 1e-9);
    tests.log10() - (n - 2.0) * divergence((k - 2.0) / (n - 2.0), p) / LN_10
}

/// Kullback-Leibler divergence of a share from the probability of an event; zero for a share at or below it.
fn divergence(share: f64, p: f64) -> f64 {
    if share <= p {
        return 0.0;
    }
    let against = if share < 1.0 { (1.0 - share) * ((1.0 - share) / (1.0 - p)).ln() } else { 0.0 };
    share * (share / p).ln() + against
}

/// Number of independent edges in one image, and of those that point at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Number of edges, fragments of one edge counted once.
    pub edges: usize,
    /// Number of edges that point at the point.
    pub aligned: usize,
    /// Mean probability that an edge points at the point by chance.
    pub probability: f64,
}

impl Agreement {
    /// Counts the edges of `voters`, longest first, that agree with `point`. `is_part` is scratch memory.
    #[must_use]
    pub fn count(voters: &[VotingLine], point: Vector2<f64>, is_part: &mut Vec<bool>) -> Self {
        mark_fragments(voters, is_part);
        let (mut edges, mut aligned, mut sum) = (0, 0, 0.0);
        for (line, _) in voters.iter().zip(is_part.iter()).filter(|(_, is_part)| !**is_part) {
            let support = Support::of(line, point);
            edges += 1;
            aligned += usize::from(support.is_aligned());
            sum += (4.0 * support.sigma / DIRECTIONS_RAD).min(1.0);
        }
        Self { edges, aligned, probability: sum / (edges.max(1) as f64) }
    }

    /// Logarithm to base 10 of the number of false alarms.
    #[must_use]
    pub fn log10_false_alarms(&self) -> f64 {
        log10_false_alarms(self.edges, self.aligned, self.probability)
    }
}

/// Marks the voters that are part of an earlier, longer edge.
fn mark_fragments(voters: &[VotingLine], is_part: &mut Vec<bool>) {
    is_part.clear();
    is_part.resize(voters.len(), false);
    let min_cosine = SAME_EDGE_RAD.cos();
    for (i, edge) in voters.iter().enumerate() {
        if is_part[i] {
            continue;
        }
        for (other, is_part) in voters.iter().zip(is_part.iter_mut()).skip(i + 1) {
            let near = || {
                other.ends().iter().all(|end| edge.normal.dot(&(end - edge.midpoint)).abs() <= SAME_EDGE_PX)
            };
            if !*is_part && edge.normal.dot(&other.normal).abs() >= min_cosine && near() {
                *is_part = true;
            }
        }
    }
}
