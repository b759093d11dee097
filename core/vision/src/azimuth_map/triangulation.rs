use nalgebra::{Matrix2, Point2, SymmetricEigen, Vector2};
use thiserror::Error;

use yamabico_geometry::{Pose2, angle_difference, wrap_angle};

/// Azimuth of an edge, measured from a known sensor pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Pose of the mirror axis, map from sensor.
    pub sensor: Pose2,
    /// Azimuth in the sensor frame, rad.
    pub azimuth_rad: f64,
}

impl Sighting {
    /// Azimuth in the map frame, rad.
    #[inline]
    #[must_use]
    pub fn bearing_rad(&self) -> f64 {
        wrap_angle(self.sensor.theta + self.azimuth_rad)
    }
}

/// Triangulated position of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulated {
    /// Position, map frame, m.
    pub position: Point2<f64>,
    /// Covariance, m^2.
    pub covariance: Matrix2<f64>,
    /// Sum of squared residuals over their variances.
    pub chi_squared: f64,
    /// Maximum angle between two bearings, rad.
    pub parallax_rad: f64,
    /// Number of sightings.
    pub sightings: usize,
}

impl Triangulated {
    /// Standard deviation along the major axis, m.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        largest_eigenvalue(&self.covariance).max(0.0).sqrt()
    }
}

/// Criteria for accepting a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangulationRule {
    /// Minimum parallax, rad.
    pub min_parallax_rad: f64,
    /// Maximum chi-squared per degree of freedom.
    pub max_chi_squared: f64,
    /// Maximum distance from the sensor, m.
    pub farthest_m: f64,
}

impl Default for TriangulationRule {
    fn default() -> Self {
        Self { min_parallax_rad: 5_f64.to_radians(), max_chi_squared: 4.0, farthest_m: 15.0 }
    }
}

/// Reason why an edge has no position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TriangulationError {
    /// Fewer than two sightings.
    #[error("an edge must be observed from at least two positions")]
    TooFew,
    /// The bearings are parallel.
    #[error("the bearings are parallel")]
    ParallelBearings,
    /// The parallax is too small for a reliable position.
    #[error("the bearings cross at too small an angle")]
    NoParallax,
    /// The intersection lies behind a sensor.
    #[error("the bearings cross behind the sensor")]
    Behind,
    /// The residuals are too large for one point.
    #[error("the bearings do not meet in one point")]
    Inconsistent,
    /// The intersection is too far away.
    #[error("the bearings cross too far away")]
    TooFar,
}

/// Minimum eigenvalue of the mean normal matrix, below which bearings are parallel.
const PARALLEL: f64 = 1e-6;
const MAX_ITERATIONS: usize = 50;
/// Minimum distance of a first guess near the last bearing, m, and ratio of the distances of successive guesses.
const NEAREST_GUESS_M: f64 = 0.2;
const GUESS_SPACING: f64 = 1.2;

/// Computes the point with the minimum sum of squared perpendicular distances from all bearings: Yagi et al. (1995),
/// equation 6.
///
/// # Errors
/// [`TriangulationError::TooFew`], [`TriangulationError::ParallelBearings`], and [`TriangulationError::Behind`] if the
/// point is behind any sensor.
pub fn least_squares_crossing(sightings: &[Sighting]) -> Result<Point2<f64>, TriangulationError> {
    if sightings.len() < 2 {
        return Err(TriangulationError::TooFew);
    }
    let origin = sightings[0].sensor.position();
    let (mut n, mut g) = (Matrix2::zeros(), Vector2::zeros());
    for sighting in sightings {
        let (sin, cos) = sighting.bearing_rad().sin_cos();
        let normal = Vector2::new(sin, -cos);
        n += normal * normal.transpose();
        g += normal * normal.dot(&(sighting.sensor.position() - origin));
    }
    let smallest = n.trace() - largest_eigenvalue(&n);
    let inverse = n.try_inverse().filter(|_| smallest >= PARALLEL * sightings.len() as f64);
    let position = origin + inverse.ok_or(TriangulationError::ParallelBearings)? * g;
    if sightings.iter().all(|sighting| is_ahead(sighting, position)) {
        Ok(position)
    } else {
        Err(TriangulationError::Behind)
    }
}

/// Computes the maximum likelihood point for azimuths with standard deviation `sigma_rad` > 0, starting from `guess`:
/// Gauss-Newton on angles.
///
/// Differs from Yagi et al. (1995): perpendicular distances are biased toward the robot.
///
/// # Errors
/// [`TriangulationError::ParallelBearings`] without convergence, [`TriangulationError::Behind`] if the point is behind
/// any sensor.
pub fn most_likely_crossing(
    sightings: &[Sighting],
    guess: Point2<f64>,
    sigma_rad: f64,
) -> Result<Triangulated, TriangulationError> {
    let mut position = guess;
    for _ in 0..MAX_ITERATIONS {
        let (information, pull, _) = normal_equations(sightings, position);
        let step = information.try_inverse().ok_or(TriangulationError::ParallelBearings)? * pull;
        if !step.iter().all(|x| x.is_finite()) {
            return Err(TriangulationError::ParallelBearings);
        }
        position += step;
        if step.norm() < 1e-13 {
            break;
        }
    }
    let (information, _, squares) = normal_equations(sightings, position);
    let variance = sigma_rad * sigma_rad;
    let covariance = information.try_inverse().ok_or(TriangulationError::ParallelBearings)? * variance;
    if !sightings.iter().all(|sighting| is_ahead(sighting, position)) {
        return Err(TriangulationError::Behind);
    }
    Ok(Triangulated {
        position,
        covariance,
        chi_squared: squares / variance,
        parallax_rad: parallax_rad(sightings),
        sightings: sightings.len(),
    })
}

/// Computes the maximum likelihood position of an edge and validates it against `rule`.
///
/// # Errors
/// [`TriangulationError`] for a position that fails a criterion.
pub fn triangulate(
    sightings: &[Sighting],
    sigma_rad: f64,
    rule: &TriangulationRule,
) -> Result<Triangulated, TriangulationError> {
    if sightings.len() < 2 {
        return Err(TriangulationError::TooFew);
    }
    if parallax_rad(sightings) < rule.min_parallax_rad {
        return Err(TriangulationError::NoParallax);
    }
    let freedom = sightings.len().saturating_sub(2).max(1) as f64;
    let is_consistent = |found: &Triangulated| found.chi_squared / freedom <= rule.max_chi_squared;
    let found = match least_squares_crossing(sightings) {
        Ok(guess) => most_likely_crossing(sightings, guess, sigma_rad)?,
        // The bias of the perpendicular distances toward the robot may have put an edge nearly ahead behind it.
        Err(TriangulationError::Behind) => point_ahead(sightings, sigma_rad, rule.farthest_m)
            .and_then(|guess| most_likely_crossing(sightings, guess, sigma_rad).ok())
            .filter(is_consistent)
            .ok_or(TriangulationError::Behind)?,
        Err(error) => return Err(error),
    };
    if !is_consistent(&found) {
        return Err(TriangulationError::Inconsistent);
    }
    let is_near =
        |sighting: &Sighting| (found.position - sighting.sensor.position()).norm() <= rule.farthest_m;
    if sightings.iter().all(is_near) { Ok(found) } else { Err(TriangulationError::TooFar) }
}

/// Returns the point near the last bearing, up to `farthest_m` away, that fits all bearings best; `None` if none is ahead
/// of all sensors.
fn point_ahead(sightings: &[Sighting], sigma_rad: f64, farthest_m: f64) -> Option<Point2<f64>> {
    let last = sightings.last()?;
    let distances = || (0..).map(|step| NEAREST_GUESS_M * GUESS_SPACING.powi(step));
    let bearings = (-2..=2).map(|step| last.bearing_rad() + f64::from(step) * sigma_rad);
    bearings
        .flat_map(|bearing| {
            let (sin, cos) = bearing.sin_cos();
            let points = distances().take_while(|distance| *distance <= farthest_m);
            points.map(move |distance| last.sensor.position() + distance * Vector2::new(cos, sin))
        })
        .filter(|point| sightings.iter().all(|sighting| is_ahead(sighting, *point)))
        .min_by(|a, b| normal_equations(sightings, *a).2.total_cmp(&normal_equations(sightings, *b).2))
}

/// Maximum angle between two bearings, rad in [0, pi].
#[must_use]
pub fn parallax_rad(sightings: &[Sighting]) -> f64 {
    let mut largest = 0.0_f64;
    for (i, a) in sightings.iter().enumerate() {
        let bearing = a.bearing_rad();
        for b in &sightings[..i] {
            largest = largest.max(angle_difference(bearing, b.bearing_rad()).abs());
        }
    }
    largest
}

/// Information matrix at unit variance, right-hand side, and sum of squared residuals.
fn normal_equations(sightings: &[Sighting], position: Point2<f64>) -> (Matrix2<f64>, Vector2<f64>, f64) {
    let mut sums = (Matrix2::zeros(), Vector2::zeros(), 0.0);
    for sighting in sightings {
        let away = position - sighting.sensor.position();
        let jacobian = Vector2::new(-away.y, away.x) / away.norm_squared();
        let residual = angle_difference(sighting.bearing_rad(), away.y.atan2(away.x));
        sums.0 += jacobian * jacobian.transpose();
        sums.1 += jacobian * residual;
        sums.2 += residual * residual;
    }
    sums
}

fn is_ahead(sighting: &Sighting, position: Point2<f64>) -> bool {
    let (sin, cos) = sighting.bearing_rad().sin_cos();
    Vector2::new(cos, sin).dot(&(position - sighting.sensor.position())) > 0.0
}

pub(super) fn largest_eigenvalue(m: &Matrix2<f64>) -> f64 {
    SymmetricEigen::new(*m).eigenvalues.max()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sightings(edge: Point2<f64>, errors: &[f64]) -> Vec<Sighting> {
        errors
            .iter()
            .enumerate()
            .map(|(i, error)| {
                let sensor = Pose2::new(0.06 * i as f64, 0.01 * (i as f64).powi(2), 0.05 * i as f64);
                let away = edge - sensor.position();
                Sighting { sensor, azimuth_rad: away.y.atan2(away.x) - sensor.theta + error }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn clean_bearings_meet_in_the_edge(x in -3.0..3.0, y in -3.0..3.0) {
            let edge = Point2::new(x, y);
            let seen = sightings(edge, &[0.0; 20]);
            prop_assume!(parallax_rad(&seen) > 0.1);
            prop_assume!(seen.iter().all(|s| (s.sensor.position() - edge).norm() > 0.3));
            let found = triangulate(&seen, 0.01, &TriangulationRule::default()).unwrap();
            prop_assert!((found.position - edge).norm() < 1e-9);
            prop_assert!(found.chi_squared < 1e-12);
            let twice = triangulate(&seen, 0.02, &TriangulationRule::default()).unwrap();
            prop_assert!((twice.covariance - found.covariance * 4.0).norm() < 1e-9 * found.covariance.norm());
        }

        /// The result is independent of the map's origin and orientation.
        #[test]
        fn the_origin_of_the_map_does_not_matter(
            x in -5.0..5.0, y in -5.0..5.0, turn in -3.0..3.0,
            errors in prop::collection::vec(-0.01..0.01, 12..20),
        ) {
            let seen = sightings(Point2::new(1.0, 1.5), &errors);
            let move_ = Pose2::new(x, y, turn);
            let moved: Vec<_> =
                seen.iter().map(|s| Sighting { sensor: move_.compose(&s.sensor), ..*s }).collect();
            let rule = TriangulationRule { max_chi_squared: f64::INFINITY, ..TriangulationRule::default() };
            let (a, b) = (triangulate(&seen, 0.01, &rule).unwrap(), triangulate(&moved, 0.01, &rule).unwrap());
            prop_assert!((move_.transform_point(a.position) - b.position).norm() < 1e-8);
            prop_assert!((a.chi_squared - b.chi_squared).abs() < 1e-8 * (1.0 + a.chi_squared));
        }
    }

    /// An edge slightly off the course: the perpendicular distances put it behind the later positions, the angles put it
    /// ahead.
    #[test]
    fn an_edge_nearly_ahead_is_refined_before_it_is_rejected() {
        let edge = Point2::new(1.3, 0.05);
        let seen: Vec<_> = (0..14)
            .map(|i| {
                let sensor = Pose2::new(0.06 * f64::from(i), 0.0, 0.0);
                let away = edge - sensor.position();
                let error = if i % 2 == 0 { 0.03 } else { -0.03 };
                Sighting { sensor, azimuth_rad: away.y.atan2(away.x) + error }
            })
            .collect();
        assert_eq!(least_squares_crossing(&seen), Err(TriangulationError::Behind));
        let rule = TriangulationRule { min_parallax_rad: 0.05, ..TriangulationRule::default() };
        let found = triangulate(&seen, 0.03, &rule).unwrap();
        assert!((found.position - edge).norm() < 2.0 * found.sigma_m(), "{:?}", found.position);
        assert!(found.position.x > seen[13].sensor.x, "{:?}", found.position);
    }

    #[test]
    fn unreliable_positions_are_rejected() {
        let rule = TriangulationRule::default();
        let edge = Point2::new(2.0, 1.0);
        let seen = sightings(edge, &[0.0; 12]);
        assert_eq!(triangulate(&seen[..1], 0.01, &rule), Err(TriangulationError::TooFew));
        assert_eq!(triangulate(&seen[..2], 0.01, &rule), Err(TriangulationError::NoParallax));
        let mut wild = seen.clone();
        wild[6].azimuth_rad += 0.2;
        assert_eq!(triangulate(&wild, 0.01, &rule), Err(TriangulationError::Inconsistent));
        let far = sightings(Point2::new(2.0, 40.0), &[0.0; 80]);
        assert_eq!(triangulate(&far, 0.01, &rule), Err(TriangulationError::TooFar));
        let behind: Vec<_> = seen
            .iter()
            .map(|s| Sighting { azimuth_rad: s.azimuth_rad + std::f64::consts::PI, ..*s })
            .collect();
        assert_eq!(triangulate(&behind, 0.01, &rule), Err(TriangulationError::Behind));
        let broken = [Sighting { sensor: Pose2::IDENTITY, azimuth_rad: f64::NAN }; 5];
        assert!(triangulate(&broken, 0.01, &rule).is_err());
    }
}
