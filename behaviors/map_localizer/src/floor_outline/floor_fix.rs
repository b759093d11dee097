//! Pose found from the outline of the floor, or the reason why there is none.

use thiserror::Error;
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;

/// Uniqueness of the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FloorSolution {
    /// The plan has a single solution, or the prediction selects one.
    Unique,
    /// The plan is symmetric under half a turn, and the prediction does not select a solution.
    Ambiguous {
        /// Other pose of the robot in the map frame, which fits equally well.
        other: Pose2,
    },
}

/// Pose found from the outline of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorFix {
    /// Pose and its covariance.
    pub belief: Belief,
    /// Uniqueness of the pose.
    pub solution: FloorSolution,
    /// Root mean square of the residuals, px.
    pub rms_px: f64,
    /// Common outward shift of the outline in the image, px.
    pub shift_px: f64,
    /// Number of corners used.
    pub corners: usize,
    /// Number of iterations of the fit.
    pub iterations: u32,
}

/// Reason why there is no pose.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum FloorProblem {
    /// The mask does not have the size of the camera's image.
    #[error("the size of the mask differs from the size of the camera's image")]
    ImageSizeError,
    /// Too little of the floor is visible.
    #[error("the outline has too few corners: {corners}")]
    TooFewCorners {
        /// Number of corners.
        corners: usize,
    },
    /// The corners do not determine the pose.
    #[error("the corners do not determine the pose")]
    Singular,
    /// The residuals are too large: another floor, a tilted robot or an obstacle.
    #[error("the outline does not fit the plan: root mean square {rms_px:.2} px")]
    Residual {
        /// Root mean square of the residuals, px.
        rms_px: f64,
    },
    /// The area of the outline is too small or too large.
    #[error("the area of the outline is {fraction:.2} times that of the plan")]
    Area {
        /// Area as a fraction of the plan's hull.
        fraction: f64,
    },
    /// A large part of the outline is occluded.
    #[error("no corner is visible within an angle of {gap_rad:.2} rad")]
    Gap {
        /// Maximum angle between the directions of adjacent corners, rad.
        gap_rad: f64,
    },
    /// The pose is too far from the prediction.
    #[error("the squared Mahalanobis distance from the prediction is too large: {distance_squared:.1}")]
    Jump {
        /// Squared Mahalanobis distance.
        distance_squared: f64,
    },
}
