use nalgebra::{Matrix2, Point2};

use crate::azimuth_profile::EdgeSign;

/// An edge with its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocatedEdge {
    /// On the map, meters.
    pub position: Point2<f64>,
    /// Square meters.
    pub covariance: Matrix2<f64>,
    /// How the picture changes across it; `None` where that is not known.
    pub sign: Option<EdgeSign>,
}

/// When two edges are one that was hidden for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelinkRule {
    /// Largest distance, meters.
    pub farthest_m: f64,
    /// Largest squared Mahalanobis distance, two degrees of freedom.
    pub gate: f64,
}

impl Default for RelinkRule {
    fn default() -> Self {
        Self { farthest_m: 0.15, gate: 9.210_340_371_976_184 }
    }
}

/// The squared Mahalanobis distance of two edges; infinite where there is none.
fn distance_squared(a: &LocatedEdge, b: &LocatedEdge) -> f64 {
    let apart = b.position - a.position;
    let inverse = (a.covariance + b.covariance).try_inverse();
    inverse.map_or(f64::INFINITY, |inverse| apart.dot(&(inverse * apart)))
}

/// The two as one edge, each weighted by what is known of it; `None` where they are two.
///
/// Where the sightings are at hand, triangulating all of them is better.
#[must_use]
pub fn relink(a: &LocatedEdge, b: &LocatedEdge, rule: &RelinkRule) -> Option<LocatedEdge> {
    let is_same = a.sign == b.sign
        && (b.position - a.position).norm() <= rule.farthest_m
        && distance_squared(a, b) <= rule.gate;
    if !is_same {
        return None;
    }
    let (of_a, of_b) = (a.covariance.try_inverse()?, b.covariance.try_inverse()?);
    let covariance = (of_a + of_b).try_inverse()?;
    let position = Point2::from(covariance * (of_a * a.position.coords + of_b * b.position.coords));
    Some(LocatedEdge { position, covariance, sign: a.sign })
}

/// Whether an edge of the map stands within `farthest_m` of `edge` and does not look otherwise: then what was found is the
/// edge of the map, and nothing unknown.
#[must_use]
pub fn explains(map: &[LocatedEdge], edge: &LocatedEdge, farthest_m: f64) -> bool {
    map.iter().any(|known| {
        let may_be = match (known.sign, edge.sign) {
            (Some(known), Some(seen)) => known == seen,
            _ => true,
        };
        may_be && (known.position - edge.position).norm() < farthest_m
    })
}
