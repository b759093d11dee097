//! Robust consensus of many measurements on a shift of the pose.
//!
//! Graduated least squares with Geman-McClure weights: the kernel starts so wide that all measurements count and
//! shrinks step by step, so that a wrong match that happens to fit the prior does not attract the others.

use nalgebra::{Matrix3, Vector3};

use super::association::GATE_99;
use super::projected_line::Residual;

/// Factor by which the kernel width shrinks per step.
const SHRINKING: f64 = 1.4;
/// Maximum number of steps.
const MAX_STEPS: usize = 40;

/// Residual of a candidate match at the prior, with its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedResidual {
    /// Distances of both ends of the segment from the projected edge.
    pub residual: Residual,
    /// Variance of the distance of each end, px².
    pub variance: f64,
}

/// Shift of the prior on which most measurements agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consensus {
    /// Shift of (x, y, theta), to be added to the prior.
    pub shift: Vector3<f64>,
    /// Covariance of the shifted pose.
    pub covariance: Matrix3<f64>,
}

impl WeightedResidual {
    /// Returns the squared distance of both ends after a shift, divided by the variance.
    #[must_use]
    #[inline]
    pub fn normalized_distance_squared(&self, shift: &Vector3<f64>) -> f64 {
        (self.residual.distance_px + self.residual.jacobian * shift).norm_squared() / self.variance
    }
}

/// Finds the shift on which most measurements agree, given the covariance of the prior; `None` if that is singular.
#[must_use]
pub fn find_consensus(prior: &Matrix3<f64>, measurements: &[WeightedResidual]) -> Option<Consensus> {
    let information = prior.try_inverse()?;
    let mut consensus = Consensus { shift: Vector3::zeros(), covariance: *prior };
    let worst =
        measurements.iter().map(|m| m.normalized_distance_squared(&consensus.shift)).fold(0.0, f64::max);
    let mut width = (2.0 * worst / GATE_99).max(1.0);
    for _ in 0..MAX_STEPS {
        let mut normal = information;
        let mut rhs = Vector3::zeros();
        for measurement in measurements {
            let scaled = width * GATE_99;
            let ratio = scaled / (scaled + measurement.normalized_distance_squared(&consensus.shift));
            let weight = ratio * ratio / measurement.variance;
            let h = &measurement.residual.jacobian;
            let r = &measurement.residual.distance_px;
            for i in 0..2 {
                let row = h.row(i);
                for a in 0..3 {
                    let weighted = weight * row[a];
                    rhs[a] -= weighted * r[i];
                    for b in a..3 {
                        normal[(a, b)] += weighted * row[b];
                    }
                }
            }
        }
        normal[(1, 0)] = normal[(0, 1)];
        normal[(2, 0)] = normal[(0, 2)];
        normal[(2, 1)] = normal[(1, 2)];
        let covariance = normal.try_inverse()?;
        consensus = Consensus { shift: covariance * rhs, covariance };
        if width <= 1.0 {
            break;
        }
        width = (width / SHRINKING).max(1.0);
    }
    consensus.shift.iter().all(|value| value.is_finite()).then_some(consensus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2x3, Vector2};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn half_of_the_measurements_may_be_wrong() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(3);
        let truth = Vector3::new(0.05, -0.03, 0.02);
        for _ in 0..50 {
            let mut of = |max: f64| random.random_range(-max..max);
            let measurements: Vec<WeightedResidual> = (0..30)
                .map(|i| {
                    let jacobian =
                        Matrix2x3::new(of(60.0), of(60.0), of(300.0), of(60.0), of(60.0), of(300.0));
                    let noise = Vector2::new(of(0.5), of(0.5));
                    // The wrong ones lie anywhere within the gates.
                    let wrong = if i % 2 == 0 { Vector2::zeros() } else { Vector2::new(of(25.0), of(25.0)) };
                    let distance_px = noise + wrong - jacobian * truth;
                    WeightedResidual { residual: Residual { distance_px, jacobian }, variance: 0.5 }
                })
                .collect();
            let prior = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.002));
            let consensus = find_consensus(&prior, &measurements).unwrap();
            assert!((consensus.shift - truth).xy().norm() < 0.01, "{:?}", consensus.shift);
        }
    }

    #[test]
    fn without_measurements_the_prior_stays() {
        let prior = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.003));
        let consensus = find_consensus(&prior, &[]).unwrap();
        assert_eq!(consensus.shift, Vector3::zeros());
        assert!((consensus.covariance - prior).norm() < 1e-12);
        assert!(find_consensus(&Matrix3::zeros(), &[]).is_none());
    }
}
