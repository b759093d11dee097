//! Vanishing point of the corridor axis.
//!
//! Kweon et al. (1991) let every edge vote, as a Gaussian across its line, for the points that it may pass through.
//! Here the intersections of pairs of lines vote on a coarse grid, a weighted least squares fit to the lines gives the
//! sub-pixel position with its covariance, and a point far outside the image is found as a direction from the
//! interpretation planes of the lines.

mod finder;
mod interpretation_plane;
mod lines;
pub(crate) mod pair_votes;
mod refine;
mod votes;

pub use finder::{VanishingPointConfig, VanishingPointFinder};
pub use lines::VotingLine;
pub use refine::{RefineRule, Refined, refine};

use nalgebra::{Matrix2, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::Intrinsics;

/// Vanishing point of the corridor axis. Borrows the list of inliers from its finder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VanishingPoint<'a> {
    /// Position in the undistorted image, px. May lie far outside; clamped to 1e7 px from the principal point.
    pub pixel: Vector2<f64>,
    /// Unit vector along the corridor axis in the optical frame (x right, y down, z forward).
    pub direction: Vector3<f64>,
    /// Covariance of `pixel`, px^2. For a point at infinity: angular covariance across the axis (sideways, upward)
    /// times fx^2.
    pub covariance: Matrix2<f64>,
    /// Indices of the segments that meet at the point.
    pub inliers: &'a [usize],
    /// Total length of the inliers, px, reduced if they are nearly parallel.
    pub score: f64,
    /// Maximum angle between two inliers, rad.
    pub spread_rad: f64,
    /// True if the point lies far outside the image and was found as a direction: use `direction`, not `pixel`.
    pub at_infinity: bool,
}

impl VanishingPoint<'_> {
    /// Root of the trace of the covariance, px.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.covariance.trace().max(0.0).sqrt()
    }
}

/// Predicted direction of the corridor axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Unit vector along the corridor axis in the optical frame.
    pub direction: Vector3<f64>,
    /// Standard deviation of the angle, rad, > 0.
    pub sigma_rad: f64,
}

impl Prediction {
    /// Creates a prediction at `pixel` with standard deviation `sigma_px`.
    #[must_use]
    pub fn at_pixel(pixel: Vector2<f64>, sigma_px: f64, camera: &Intrinsics) -> Self {
        Self { direction: ray(pixel, camera), sigma_rad: sigma_px / camera.fx }
    }
}

/// Reason why there is no vanishing point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum VanishingPointError {
    /// Fewer segments than a vanishing point needs.
    #[error("{found} segments are too few for a vanishing point")]
    TooFewSegments {
        /// Number of segments that may belong to the corridor.
        found: usize,
    },
    /// The lines do not meet in one point.
    #[error("the segments do not meet in one point")]
    NoVanishingPoint,
    /// The lines are nearly parallel in the image.
    #[error("the segments are nearly parallel")]
    Degenerate,
    /// Two points have similar scores, and there is no prediction.
    #[error("two vanishing points have similar scores")]
    Ambiguous,
}

/// Unit vector along the ray of a pixel, optical frame.
fn ray(pixel: Vector2<f64>, camera: &Intrinsics) -> Vector3<f64> {
    let at = camera.normalized_from_pixel(pixel);
    Vector3::new(at.x, at.y, 1.0).normalize()
}

/// Projects a direction to a pixel, clamped to 1e7 px from the principal point.
fn pixel(direction: Vector3<f64>, camera: &Intrinsics) -> Vector2<f64> {
    let limit = 1e7;
    let depth = if direction.z.abs() < 1e-9 { 1e-9_f64.copysign(direction.z) } else { direction.z };
    Vector2::new(
        camera.cx + (camera.fx * direction.x / depth).clamp(-limit, limit),
        camera.cy + (camera.fy * direction.y / depth).clamp(-limit, limit),
    )
}
