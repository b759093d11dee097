use nalgebra::{Matrix2, Point2, Vector2};
use thiserror::Error;
use yamabico_core::geometry::{Pose2, wrap_angle};

use super::solver::BearingPair;

/// Search over the heading: finds the position by least squares of the perpendicular distances for each of several
/// headings, and selects the heading with the smallest sum of squares.
///
/// Yagi et al. (1995) \[1\], equations 7 and 8. Differs from \[1\]: a parabola through the costs refines the heading,
/// and a minimum at the end of the range doubles the range once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanSearch {
    /// Number of headings on each side of the predicted one.
    pub steps: i32,
    /// Spacing of the headings, rad.
    pub step_rad: f64,
}

impl Default for PanSearch {
    fn default() -> Self {
        Self { steps: 10, step_rad: 0.5_f64.to_radians() }
    }
}

/// Pose found by a [`PanSearch`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanFix {
    /// Offset of the best heading from the predicted one, in steps.
    pub step: i32,
    /// Best heading of the grid, with its position.
    pub coarse: Pose2,
    /// Sum of squared distances of the coarse pose, m².
    pub cost: f64,
    /// Refined heading, with its position.
    pub pose: Pose2,
}

/// Reason why a [`PanSearch`] found no pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PanError {
    /// Fewer than three pairs, which fit at any heading.
    #[error("at least three edges are required")]
    TooFew,
    /// All edges lie in one direction.
    #[error("the edges do not determine the position")]
    Singular,
    /// The best heading is at the end of the range, even of the doubled one.
    #[error("the heading is outside of the search range")]
    AtEnd,
}

impl PanSearch {
    /// Searches around a predicted heading (rad).
    ///
    /// # Errors
    /// The pairs do not determine the pose, or the heading is outside of the search range.
    pub fn find(&self, pairs: &[BearingPair], heading_rad: f64) -> Result<PanFix, PanError> {
        if pairs.len() < 3 {
            return Err(PanError::TooFew);
        }
        [self.steps, 2 * self.steps]
            .into_iter()
            .map(|steps| self.within(steps, pairs, heading_rad))
            .find(|found| *found != Err(PanError::AtEnd))
            .unwrap_or(Err(PanError::AtEnd))
    }

    fn within(&self, steps: i32, pairs: &[BearingPair], heading_rad: f64) -> Result<PanFix, PanError> {
        let at = |step: f64| position(pairs, heading_rad + step * self.step_rad).ok_or(PanError::Singular);
        let mut best = (0, f64::INFINITY);
        for step in -steps..=steps {
            let (_, cost) = at(f64::from(step))?;
            if cost < best.1 {
                best = (step, cost);
            }
        }
        let (step, cost) = best;
        if step.abs() >= steps || !cost.is_finite() {
            return Err(PanError::AtEnd);
        }
        let middle = f64::from(step);
        let (before, after) = (at(middle - 1.0)?.1, at(middle + 1.0)?.1);
        let curvature = before - 2.0 * cost + after;
        let offset = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
        let pose = |step: f64| -> Result<Pose2, PanError> {
            let (position, _) = at(step)?;
            let theta = wrap_angle(heading_rad + step * self.step_rad);
            Ok(Pose2 { x: position.x, y: position.y, theta })
        };
        Ok(PanFix { step, coarse: pose(middle)?, cost, pose: pose(middle + offset)? })
    }
}

/// Returns the position for a heading and its sum of squared perpendicular distances.
fn position(pairs: &[BearingPair], heading_rad: f64) -> Option<(Point2<f64>, f64)> {
    let normal = |pair: &BearingPair| {
        let (sin, cos) = (heading_rad + pair.seen.azimuth_rad).sin_cos();
        Vector2::new(sin, -cos)
    };
    let (mut n, mut g) = (Matrix2::zeros(), Vector2::zeros());
    for pair in pairs {
        let normal = normal(pair);
        n += normal * normal.transpose();
        g += normal * normal.dot(&pair.landmark.position.coords);
    }
    let position = Point2::from(n.try_inverse()? * g);
    let cost = pairs.iter().map(|pair| normal(pair).dot(&(pair.landmark.position - position)).powi(2)).sum();
    Some((position, cost))
}
