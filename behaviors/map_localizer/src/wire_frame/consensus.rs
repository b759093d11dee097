//! The shift of a pose that most measurements agree on, whatever the others say.
//!
//! Least squares with the weights of Geman and McClure, begun so wide that every measurement counts and narrowed step by step:
//! a wrong match that happens to fit the prior cannot draw the others after it.

use nalgebra::{Matrix3, Vector3};

use super::association::GATE;
use super::projected_line::Residual;

/// The width shrinks by this factor from step to step.
const NARROWING: f64 = 1.4;
/// Most steps.
const STEPS: usize = 40;

/// A residual at the prior with its variance, pixels squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Witness {
    /// Of both ends.
    pub residual: Residual,
    /// Of either end.
    pub variance: f64,
}

/// What the witnesses agree on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Of (x, y, theta), to be added to the prior.
    pub shift: Vector3<f64>,
    /// Of the shifted pose.
    pub covariance: Matrix3<f64>,
}

impl Witness {
    /// The squared distance of both ends after a shift, in variances.
    #[must_use]
    #[inline]
    pub fn surprise(&self, shift: &Vector3<f64>) -> f64 {
        (self.residual.distance_px + self.residual.jacobian * shift).norm_squared() / self.variance
    }
}

/// The shift that most witnesses agree on, given the prior's covariance; `None` for a prior without an inverse.
#[must_use]
pub fn agree(prior: &Matrix3<f64>, witnesses: &[Witness]) -> Option<Agreement> {
    let information = prior.try_inverse()?;
    let mut agreement = Agreement { shift: Vector3::zeros(), covariance: *prior };
    let worst = witnesses.iter().map(|witness| witness.surprise(&agreement.shift)).fold(0.0, f64::max);
    let mut width = (2.0 * worst / GATE).max(1.0);
    for _ in 0..STEPS {
        let mut normal = information;
        let mut pull = Vector3::zeros();
        for witness in witnesses {
            let scaled = width * GATE;
            let share = scaled / (scaled + witness.surprise(&agreement.shift));
            let weight = share * share / witness.variance;
            let h = &witness.residual.jacobian;
            let r = &witness.residual.distance_px;
            for i in 0..2 {
                let row = h.row(i);
                for a in 0..3 {
                    let weighted = weight * row[a];
                    pull[a] -= weighted * r[i];
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
        agreement = Agreement { shift: covariance * pull, covariance };
        if width <= 1.0 {
            break;
        }
        width = (width / NARROWING).max(1.0);
    }
    agreement.shift.iter().all(|value| value.is_finite()).then_some(agreement)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2x3, Vector2};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn half_of_the_witnesses_may_be_wrong() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(3);
        let truth = Vector3::new(0.05, -0.03, 0.02);
        for _ in 0..50 {
            let mut of = |most: f64| random.random_range(-most..most);
            let witnesses: Vec<Witness> = (0..30)
                .map(|i| {
                    let jacobian =
                        Matrix2x3::new(of(60.0), of(60.0), of(300.0), of(60.0), of(60.0), of(300.0));
                    let noise = Vector2::new(of(0.5), of(0.5));
                    // The wrong ones lie within the gates anywhere.
                    let wrong = if i % 2 == 0 { Vector2::zeros() } else { Vector2::new(of(25.0), of(25.0)) };
                    let distance_px = noise + wrong - jacobian * truth;
                    Witness { residual: Residual { distance_px, jacobian }, variance: 0.5 }
                })
                .collect();
            let prior = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.002));
            let agreement = agree(&prior, &witnesses).unwrap();
            assert!((agreement.shift - truth).xy().norm() < 0.01, "{:?}", agreement.shift);
        }
    }

    #[test]
    fn without_witnesses_the_prior_stays() {
        let prior = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.003));
        let agreement = agree(&prior, &[]).unwrap();
        assert_eq!(agreement.shift, Vector3::zeros());
        assert!((agreement.covariance - prior).norm() < 1e-12);
        assert!(agree(&Matrix3::zeros(), &[]).is_none());
    }
}
