use nalgebra::{Matrix3, Vector3};
use thiserror::Error;
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing, predict_from};
use crate::belief::{Belief, Update, difference};

/// An edge seen and the edge of the map that it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingPair {
    /// Of the map.
    pub landmark: EdgeLandmark,
    /// Of the picture.
    pub seen: SeenBearing,
}

/// How much a pair counts that lies far off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// As much as any other.
    #[default]
    Squares,
    /// Less beyond so many standard deviations (1.345 as a rule); a gross error still pulls.
    Huber(f64),
    /// Nothing beyond so many standard deviations (4.685 as a rule). Until the pose nearly stands still it is Huber's, so that
    /// a first guess that lies far off is not kept for want of anything near.
    Tukey(f64),
}

/// How the most likely pose is sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverRule {
    /// What becomes of pairs that lie far off.
    pub loss: Loss,
    /// A step shorter than this (meters and radians) is the last.
    pub settled: f64,
    /// Steps after which a pose that still moves is given up.
    pub max_iterations: u32,
}

impl SolverRule {
    /// Until nothing moves any more: for comparisons.
    #[must_use]
    pub fn exact(loss: Loss) -> Self {
        Self { loss, settled: 1e-11, max_iterations: 200 }
    }
}

impl Default for SolverRule {
    /// To the hundredth of a millimeter, far below what azimuths tell.
    fn default() -> Self {
        Self { loss: Loss::Tukey(4.685), settled: 1e-5, max_iterations: 50 }
    }
}

/// The most likely pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The pose and its covariance.
    pub belief: Belief,
    /// Sum of the squared residuals of the azimuths over their variances.
    pub chi_squared: f64,
    /// Squared Mahalanobis distance from the prior; 0 without one.
    pub from_prior: f64,
    /// Steps until it stood still.
    pub iterations: u32,
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SolverError {
    /// Fewer than three pairs, and no prior.
    #[error("three edges at least are needed where nothing is known of the pose")]
    TooFew,
    /// The edges leave the pose open: robot and edges on one circle, or the prior is no covariance.
    #[error("the edges do not fix the pose")]
    Singular,
    /// The steps did not come to an end.
    #[error("the pose did not settle")]
    Unsettled,
}

/// Beyond so many standard deviations a residual counts less.
const HUBER: f64 = 1.345;
/// A step shorter than this (m and rad) leads to where the pairs that lie far off can be told.
const NEARLY_SETTLED: f64 = 2e-3;

/// The pose that makes the azimuths, and the prior if there is one, most likely: Gauss-Newton from `guess`, which for squares
/// from the prior is the iterated extended Kalman filter.
///
/// # Errors
/// [`SolverError`].
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
        let (information, pull, chi_squared) = normal_equations(pairs, &pose, known.as_ref(), loss, lever);
        let covariance = inverse_of(&information).ok_or(SolverError::Singular)?;
        let step: Vector3<f64> = covariance * pull;
        if !step.iter().all(|x| x.is_finite()) {
            return Err(SolverError::Singular);
        }
        pose = Pose2 { x: pose.x + step.x, y: pose.y + step.y, theta: wrap_angle(pose.theta + step.z) };
        if loss != rule.loss {
            if step.amax() < NEARLY_SETTLED {
                loss = rule.loss;
            }
        } else if step.amax() < rule.settled {
            let from_prior = known.as_ref().map_or(0.0, |(prior, information)| {
                let off = difference(prior, &pose);
                off.dot(&(information * off))
            });
            let belief = Belief { pose, covariance };
            return Ok(Solution { belief, chi_squared, from_prior, iterations: iteration });
        }
    }
    Err(SolverError::Unsettled)
}

/// Applies the pairs to the belief one after the other, each within the gate (squared Mahalanobis distance), and tells how many
/// were: the extended Kalman filter. Where the prediction is far off, [`most_likely_pose`] is better.
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
    let (mut information, mut pull, mut chi_squared) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    if let Some((known, of_prior)) = prior {
        let off = difference(known, pose);
        information += of_prior;
        pull += of_prior * off;
    }
    let (sin, cos) = pose.theta.sin_cos();
    for pair in pairs {
        let found = predict_from(&pair.landmark, pose, [sin, cos], lever);
        let residual = angle_difference(pair.seen.azimuth_rad, found.azimuth_rad);
        let variance = pair.seen.sigma_rad.powi(2) + found.landmark_variance;
        let weight = loss.weight(residual.abs() / variance.sqrt()) / variance;
        let h = &found.jacobian;
        information += h.transpose() * (weight * h);
        pull += h.transpose() * (weight * residual);
        chi_squared += weight * residual * residual;
    }
    (information, pull, chi_squared)
}

impl Loss {
    /// The weight of a residual of so many standard deviations, 0 to 1.
    #[must_use]
    pub fn weight(self, deviations: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber(knee) if deviations <= knee => 1.0,
            Self::Huber(knee) => knee / deviations,
            Self::Tukey(end) if deviations < end => (1.0 - (deviations / end).powi(2)).powi(2),
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
    fn the_covariance_is_that_of_the_errors() {
        let mut normal = noise();
        let lever = LeverArm::new(0.1, 0.02);
        let (mut nees, mut of_filter) = (0.0, 0.0);
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
            of_filter += belief.distance_squared(&truth) / TRIALS as f64;
        }
        assert!((nees - 3.0).abs() < 0.3, "{nees}");
        assert!((of_filter - 3.0).abs() < 0.3, "{of_filter}");
    }

    #[test]
    fn a_gross_error_does_not_move_the_pose() {
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
    fn what_does_not_fix_the_pose_says_so() {
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
