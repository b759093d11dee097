//! Support of a vanishing point by single segments.

use crate::vanishing_point::VotingLine;
use nalgebra::Vector2;

/// Standard deviation of the direction of an edge of the scene, rad.
const SIGMA_EDGE_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Standard deviation of a segment's endpoint across the segment, px.
const SIGMA_END_PX: f64 = 0.5;
/// Standard deviation of the vanishing point, px.
const SIGMA_POINT_PX: f64 = 2.0;
/// Distance of a midpoint from the vanishing point below which a segment does not count, px.
pub const NEAR_PX: f64 = 8.0;
/// Support above which a segment counts toward the spread of directions.
const SPREAD_SUPPORT: f64 = 0.3;
/// Spread at which the score saturates, rad.
const FULL_SPREAD_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Relation of one segment to a vanishing point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Angle between the segment and the direction from its midpoint to the point, rad.
    pub angle: f64,
    /// Standard deviation of that angle, rad.
    pub sigma: f64,
    /// Distance between midpoint and point, px.
    pub range_px: f64,
    /// True if the point projects into the segment: an edge never crosses its own vanishing point.
    pub straddles: bool,
}

impl Support {
    /// Relates `line` to `point`; pixels of an image 640 px wide.
    #[must_use]
    pub fn of(line: &VotingLine, point: Vector2<f64>) -> Self {
        let offset = point - line.midpoint;
        let range_px = offset.norm();
        let sine = line.normal.dot(&offset).abs() / range_px.max(1e-9);
        let by_ends = 2.0 * (SIGMA_END_PX / line.length).powi(2);
        let by_point = (SIGMA_POINT_PX / range_px.max(1.0)).powi(2);
        Self {
            angle: sine.min(1.0).asin(),
            sigma: (SIGMA_EDGE_RAD * SIGMA_EDGE_RAD + by_ends + by_point).sqrt(),
            range_px,
            straddles: line.straddles(point),
        }
    }

    /// Weight of the segment: 1 if it points at the vanishing point exactly, 0 beyond three standard deviations.
    #[must_use]
    pub fn kappa(&self) -> f64 {
        if self.angle > 3.0 * self.sigma || self.straddles || self.range_px < NEAR_PX {
            0.0
        } else {
            (-0.5 * (self.angle / self.sigma).powi(2)).exp()
        }
    }

    /// True if the segment points at the vanishing point within two standard deviations.
    #[must_use]
    pub fn is_aligned(&self) -> bool {
        self.angle <= 2.0 * self.sigma && self.range_px >= NEAR_PX && !self.straddles
    }
}

/// Fills `kappas` with the support of every line for `point`.
pub fn kappas(lines: &[VotingLine], point: Vector2<f64>, kappas: &mut Vec<f64>) {
    kappas.clear();
    kappas.extend(lines.iter().map(|line| Support::of(line, point).kappa()));
}

/// Score of a point with these supports: the supporting length, px, reduced if the supporters are nearly parallel.
#[must_use]
pub fn score(lines: &[VotingLine], kappas: &[f64]) -> f64 {
    let length: f64 = lines.iter().zip(kappas).map(|(line, kappa)| kappa * line.length).sum();
    length * (spread(lines, kappas, FULL_SPREAD_RAD) / FULL_SPREAD_RAD).min(1.0)
}

/// Maximum angle between two supporters, rad, at most pi/2; the first found that reaches `enough` (rad) is returned.
#[must_use]
pub fn spread(lines: &[VotingLine], kappas: &[f64], enough: f64) -> f64 {
    let enough = enough.sin();
    let supports = |i: &usize| kappas[*i] > SPREAD_SUPPORT;
    let mut largest = 0.0_f64;
    for i in (0..lines.len()).filter(supports) {
        for j in (0..i).filter(supports) {
            let (a, b) = (lines[i].normal, lines[j].normal);
            largest = largest.max((a.x * b.y - a.y * b.x).abs());
        }
        if largest >= enough {
            break;
        }
    }
    largest.min(1.0).asin()
}
