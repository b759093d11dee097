use nalgebra::{Matrix2, Point2};

use crate::azimuth_profile::EdgeSign;

/// Edge with its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocatedEdge {
    /// Position, map frame, m.
    pub position: Point2<f64>,
    /// Covariance, m^2.
    pub covariance: Matrix2<f64>,
    /// Sign of the brightness change; `None` if unknown.
    pub sign: Option<EdgeSign>,
}

/// Criteria for two edges being the same one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelinkRule {
    /// Maximum distance, m.
    pub farthest_m: f64,
    /// Maximum squared Mahalanobis distance, two degrees of freedom.
    pub gate: f64,
}

impl Default for RelinkRule {
    fn default() -> Self {
        Self { farthest_m: 0.15, gate: 9.210_340_371_976_184 }
    }
}

/// Squared Mahalanobis distance of two edges; infinite if the covariance is singular.
fn distance_squared(a: &LocatedEdge, b: &LocatedEdge) -> f64 {
    let apart = b.position - a.position;
    let inverse = (a.covariance + b.covariance).try_inverse();
    inverse.map_or(f64::INFINITY, |inverse| apart.dot(&(inverse * apart)))
}

/// Merges two observations of the same edge, weighted by their information; `None` if they are different edges.
///
/// If the sightings are available, triangulating all of them is more accurate.
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

/// Returns true if an edge of the map with a compatible sign lies within `farthest_m` of `edge`, so that `edge` is not
/// an unknown obstacle.
#[must_use]
pub fn is_explained(map: &[LocatedEdge], edge: &LocatedEdge, farthest_m: f64) -> bool {
    map.iter().any(|known| {
        let may_be = match (known.sign, edge.sign) {
            (Some(known), Some(seen)) => known == seen,
            _ => true,
        };
        may_be && (known.position - edge.position).norm() < farthest_m
    })
}
