use nalgebra::{Matrix3, Vector3};
use thiserror::Error;
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing, predict_from};
use crate::belief::{Belief, Update, difference};

/// Pair of an observed edge and its map edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingPair {
    /// Map edge.
    pub landmark: EdgeLandmark,
    /// Observed edge.
    pub seen: SeenBearing,
}

/// Loss function of the residuals. Its parameter is in standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// Least squares: all residuals have the same weight.
    #[default]
    Squares,
    /// Huber: lower weights above this residual (usually 1.345); outliers keep some influence.
    Huber(f64),
    /// Tukey: zero weight above this residual (usually 4.685). Huber is used until the pose has nearly converged, so
    /// that a poor initial guess does not exclude all pairs.
    Tukey(f64),
}

/// Loss and termination of the optimization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverRule {
    /// Loss function of the residuals.
    pub loss: Loss,
    /// Step (m and rad) below which the pose has converged.
    pub tolerance: f64,
    /// Maximum number of iterations.
    pub max_iterations: u32,
}

impl SolverRule {
    /// Iterates to numerical convergence, for comparisons.
    #[must_use]
    pub fn exact(loss: Loss) -> Self {
        Self { loss, tolerance: 1e-11, max_iterations: 200 }
    }
}

impl Default for SolverRule {
    /// Uses the Tukey loss and a tolerance of 0.01 mm, far below the accuracy of the azimuths.
    fn default() -> Self {
        Self { loss: Loss::Tukey(4.685), tolerance: 1e-5, max_iterations: 50 }
    }
}

/// Maximum-likelihood pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Pose and its covariance.
    pub belief: Belief,
    /// Sum of the squared normalized residuals of the azimuths.
    pub chi_squared: f64,
    /// Squared Mahalanobis distance from the prior; 0 without a prior.
    pub prior_distance_squared: f64,
    /// Number of iterations.
    pub iterations: u32,
}

/// Reason why the optimization found no pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SolverError {
    /// Fewer than three pairs without a prior.
    #[error("at least three edges are required without a prior pose")]
    TooFew,
    /// The edges do not determine the pose (robot and edges on one circle), or the covariance of the prior is singular.
    #[error("the edges do not determine the pose")]
    Singular,
    /// The optimization did not converge.
    #[error("the pose did not converge")]
    NotConverged,
}

/// Parameter of the Huber loss that precedes the Tukey loss, in standard deviations.
const HUBER: f64 = 1.345;
/// Step (m and rad) below which the Huber loss is replaced by the Tukey loss.
const SWITCH_TOLERANCE: f64 = 2e-3;

/// Finds the maximum-likelihood pose given the azimuths and an optional prior, by Gauss-Newton iteration from `guess`.
/// With least squares and the prior as the guess, it equals the iterated extended Kalman filter.
///
/// # Errors
/// The pairs and the prior do not determine the pose, or the iteration does not converge.
pub fn most_likely_pose(
    pairs: &[BearingPair],
    guess: &Pose2,
    prior: Option<&Belief>,
    rule: &SolverRule,
    lever: LeverArm,
) -> Result<Solution, SolverError> {
    if pairs.len() < 3 && prior.is_none() {
        return Err(SolverError::TooFew);
    }
    let known = match prior {
        Some(prior) => {
            let information = prior.covariance.try_inverse().ok_or(SolverError::Singular)?;
            Some((prior.pose, information))
        }
        None => None,
    };
    let mut pose = *guess;
    let mut loss = match rule.loss {
        Loss::Tukey(_) => Loss::Huber(HUBER),
        other => other,
    };
    for iteration in 1..=rule.max_iterations {
        let (information, rhs, chi_squared) = normal_equations(pairs, &pose, known.as_ref(), loss, lever);
        let covariance = inverse_of(&information).ok_or(SolverError::Singular)?;
        let step: Vector3<f64> = covariance * rhs;
        if !step.iter().all(|x| x.is_finite()) {
            return Err(SolverError::Singular);
        }
        pose = Pose2 { x: pose.x + step.x, y: pose.y + step.y, theta: wrap_angle(pose.theta + step.z) };
        if loss != rule.loss {
            if step.amax() < SWITCH_TOLERANCE {
                loss = rule.loss;
            }
        } else if step.amax() < rule.tolerance {
            let prior_distance_squared = known.as_ref().map_or(0.0, |(prior, information)| {
                let off = difference(prior, &pose);
                off.dot(&(information * off))
            });
            let belief = Belief { pose, covariance };
            return Ok(Solution { belief, chi_squared, prior_distance_squared, iterations: iteration });
        }
    }
    Err(SolverError::NotConverged)
}

/// Updates the belief with the pairs in sequence by an extended Kalman filter and returns the number of pairs within
/// the gate (squared Mahalanobis distance). [`most_likely_pose`] is more accurate if the prior is far off.
pub fn filter(belief: &mut Belief, pairs: &[BearingPair], gate: f64, lever: LeverArm) -> usize {
    let is_applied = |pair: &&BearingPair| {
        let (sin, cos) = belief.pose.theta.sin_cos();
        let found = predict_from(&pair.landmark, &belief.pose, [sin, cos], lever);
        let innovation = angle_difference(pair.seen.azimuth_rad, found.azimuth_rad);
        let noise = pair.seen.sigma_rad.powi(2) + found.landmark_variance;
        matches!(belief.update_scalar(innovation, &found.jacobian, noise, gate), Update::Applied(_))
    };
    pairs.iter().filter(is_applied).count()
}

fn normal_equations(
    pairs: &[BearingPair],
    pose: &Pose2,
    prior: Option<&(Pose2, Matrix3<f64>)>,
    loss: Loss,
    lever: LeverArm,
) -> (Matrix3<f64>, Vector3<f64>, f64) {
    let (mut information, mut rhs, mut chi_squared) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    if let Some((known, prior_information)) = prior {
        let off = difference(known, pose);
        information += prior_information;
        rhs += prior_information * off;
    }
    let (sin, cos) = pose.theta.sin_cos();
    for pair in pairs {
        let found = predict_from(&pair.landmark, pose, [sin, cos], lever);
        let residual = angle_difference(pair.seen.azimuth_rad, found.azimuth_rad);
        let variance = pair.seen.sigma_rad.powi(2) + found.landmark_variance;
        let weight = loss.weight(residual.abs() / variance.sqrt()) / variance;
        let h = &found.jacobian;
        information += h.transpose() * (weight * h);
        rhs += h.transpose() * (weight * residual);
        chi_squared += weight * residual * residual;
    }
    (information, rhs, chi_squared)
}

impl Loss {
    /// Returns the weight of a residual given in standard deviations, 0 to 1.
    #[must_use]
    pub fn weight(self, deviations: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber(limit) if deviations <= limit => 1.0,
            Self::Huber(limit) => limit / deviations,
            Self::Tukey(limit) if deviations < limit => (1.0 - (deviations / limit).powi(2)).powi(2),
            Self::Tukey(_) => 0.0,
        }
    }
}

fn inverse_of(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    m.cholesky().map(|factor| factor.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;
    use rand::{RngExt, SeedableRng};

    fn pairs(pose: &Pose2, lever: LeverArm, mut error: impl FnMut() -> f64) -> Vec<BearingPair> {
        let edges =
            [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (1.2, 0.0), (4.0, 1.5), (0.5, 3.2), (3.0, 3.0)];
        edges
            .iter()
            .map(|&(x, y)| {
                let landmark = EdgeLandmark { position: Point2::new(x, y), sign: None, sigma_m: 0.0 };
                let (sin, cos) = pose.theta.sin_cos();
                let azimuth_rad = predict_from(&landmark, pose, [sin, cos], lever).azimuth_rad + error();
                BearingPair { landmark, seen: SeenBearing { azimuth_rad, sign: None, sigma_rad: 0.01 } }
            })
            .collect()
    }

    fn noise() -> impl FnMut() -> f64 {
        let mut random = rand_pcg::Pcg64::seed_from_u64(11);
        move || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>()
    }

    #[test]
    fn the_covariance_matches_the_errors() {
        let mut normal = noise();
        let lever = LeverArm::new(0.1, 0.02);
        let (mut nees, mut filter_nees) = (0.0, 0.0);
        const TRIALS: usize = 1000;
        for trial in 0..TRIALS {
            let truth = Pose2::new(1.0 + 0.002 * trial as f64, 2.0, 0.006 * trial as f64 - 3.0);
            let pairs = pairs(&truth, lever, || 0.01 * normal());
            let sigmas = [0.03, 0.03, 0.02];
            let shift = sigmas.map(|sigma| sigma * normal());
            let known = Belief::new(
                Pose2::new(truth.x + shift[0], truth.y + shift[1], truth.theta + shift[2]),
                0.03,
                0.02,
            );
            let found =
                most_likely_pose(&pairs, &known.pose, Some(&known), &SolverRule::exact(Loss::Squares), lever)
                    .unwrap();
            nees += found.belief.distance_squared(&truth) / TRIALS as f64;
            let mut belief = known;
            assert_eq!(filter(&mut belief, &pairs, f64::INFINITY, lever), pairs.len());
            filter_nees += belief.distance_squared(&truth) / TRIALS as f64;
        }
        assert!((nees - 3.0).abs() < 0.3, "{nees}");
        assert!((filter_nees - 3.0).abs() < 0.3, "{filter_nees}");
    }

    #[test]
    fn an_outlier_does_not_move_the_pose() {
        let truth = Pose2::new(1.7, 1.4, 0.3);
        let mut pairs = pairs(&truth, LeverArm::zeros(), || 0.0);
        pairs[2].seen.azimuth_rad += 0.3;
        let known = Belief::new(Pose2::new(1.72, 1.38, 0.31), 0.05, 0.03);
        let solve = |loss| {
            most_likely_pose(&pairs, &known.pose, Some(&known), &SolverRule::exact(loss), LeverArm::zeros())
                .unwrap()
        };
        let off = |solution: &Solution| solution.belief.pose.distance(&truth);
        assert!(off(&solve(Loss::Tukey(4.685))) < 0.004, "{}", off(&solve(Loss::Tukey(4.685))));
        assert!(off(&solve(Loss::Squares)) > 0.05);
    }

    #[test]
    fn an_undetermined_pose_is_an_error() {
        let truth = Pose2::new(1.7, 1.4, 0.3);
        let pairs = pairs(&truth, LeverArm::zeros(), || 0.0);
        let solve = |pairs: &[BearingPair]| {
            most_likely_pose(pairs, &truth, None, &SolverRule::exact(Loss::Squares), LeverArm::zeros())
        };
        assert_eq!(solve(&pairs[..2]), Err(SolverError::TooFew));
        assert_eq!(solve(&[pairs[0]; 3]), Err(SolverError::Singular));
        let flat = Belief { pose: truth, covariance: Matrix3::zeros() };
        let with_prior = most_likely_pose(
            &pairs,
            &truth,
            Some(&flat),
            &SolverRule::exact(Loss::Squares),
            LeverArm::zeros(),
        );
        assert_eq!(with_prior, Err(SolverError::Singular));
        let mut broken = pairs.clone();
        broken[0].seen.azimuth_rad = f64::NAN;
        assert!(solve(&broken).is_err());
    }
}
