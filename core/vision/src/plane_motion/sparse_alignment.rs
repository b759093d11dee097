//! Correction of motion and mount from features of the floor.

use nalgebra::Vector2;
use yamabico_geometry::Pose2;

use super::floor_view::{FloorView, Warped};
use super::motion_prior::{CommonCovariance, CommonMode};

/// Squared Mahalanobis distance up to which a feature may belong to the floor.
const GATE: f64 = 16.0;
const STEP: f64 = 1e-13;
const MAX_ROUNDS: usize = 200;

/// A feature in two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelPair {
    /// Pixel of the current picture.
    pub current: Vector2<f64>,
    /// Pixel of the previous picture.
    pub previous: Vector2<f64>,
    /// Result: true if it moved as the floor does.
    pub is_inlier: bool,
}

/// Correction of a motion and of the mount.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Value to add to motion and mount.
    pub offset: CommonMode,
    /// Covariance of the corrected motion and mount.
    pub covariance: CommonCovariance,
}

impl Correction {
    /// Motion with the correction.
    #[must_use]
    pub fn apply(&self, motion: &Pose2) -> Pose2 {
        Pose2::new(motion.x + self.offset[0], motion.y + self.offset[1], motion.theta + self.offset[2])
    }
}

/// Corrects `motion` and the mount of `view` from features with the noise `sigma_px`, of which some may not be on the
/// floor; they get no weight. `None` if the prior cannot be inverted.
#[must_use]
pub fn align_features(
    view: &FloorView,
    motion: &Pose2,
    prior: &CommonCovariance,
    sigma_px: f64,
    pairs: &mut [PixelPair],
) -> Option<Correction> {
    let information = prior.try_inverse()?;
    let variance = sigma_px * sigma_px;
    for pair in &mut *pairs {
        pair.is_inlier = view.warp_jacobian(motion, pair.current).is_some_and(|warped| {
            let slope = warped.jacobian.fixed_columns::<5>(0).into_owned();
            let mut spread = slope * prior * slope.transpose();
            spread[(0, 0)] += variance;
            spread[(1, 1)] += variance;
            let residual = pair.previous - warped.pixel;
            spread.try_inverse().is_some_and(|inverse| residual.dot(&(inverse * residual)) < GATE)
        });
    }
    let mut offset = CommonMode::zeros();
    for _ in 0..MAX_ROUNDS {
        let moved = Correction { offset, covariance: *prior }.apply(motion);
        let turned = view.turned(offset[3], offset[4]);
        let (mut normal, mut gradient) = (information, -(information * offset));
        for pair in pairs.iter().filter(|pair| pair.is_inlier) {
            let Some(Warped { pixel, jacobian }) = turned.warp_jacobian(&moved, pair.current) else {
                continue;
            };
            let slope = jacobian.fixed_columns::<5>(0).into_owned();
            let residual = pair.previous - pixel;
            let weight = (1.0 + residual.norm_squared() / (4.0 * variance)).powi(-2) / variance;
            normal += slope.transpose() * slope * weight;
            gradient += slope.transpose() * residual * weight;
        }
        let covariance = normal.try_inverse()?;
        let step = covariance * gradient;
        offset += step;
        if step.amax() < STEP {
            for pair in pairs.iter_mut().filter(|pair| pair.is_inlier) {
                let warped = turned.warp(&moved, 0.0, pair.current);
                pair.is_inlier = warped.is_some_and(|pixel| (pair.previous - pixel).norm() < 3.0 * sigma_px);
            }
            return Some(Correction { offset, covariance });
        }
    }
    None
}
