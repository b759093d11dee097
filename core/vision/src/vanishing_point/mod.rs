//! The vanishing point of the corridor: where the images of all lines along its axis meet.
//!
//! Kweon et al. (1991) let every edge vote, as a Gaussian across its line, for the points it may pass through. Here
//! the crossings of pairs of lines vote on a coarse grid, a weighted least squares fit to the lines themselves places the
//! point with its covariance, and a point far outside the picture is found as a direction, from the planes that the lines
//! span with the camera.

mod belief;
mod finder;
mod interpretation_plane;
mod lines;
mod refine;
mod votes;

pub use belief::{Belief, belief_at, belief_peak};
pub use finder::{VanishingPointConfig, VanishingPointFinder};
pub use lines::VotingLine;
pub use refine::{RefineRule, Refined, refine};

use nalgebra::{Matrix2, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::Intrinsics;

/// Where the corridor's axis points, as the camera sees it. Borrows the list of inliers from its finder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VanishingPoint<'a> {
    /// Place in the (undistorted) picture, px; it may lie far outside, and is clamped to 1e7 px from the principal point.
    pub pixel: Vector2<f64>,
    /// Unit ray along the corridor's axis in the camera's optical frame (x right, y down, z forward).
    pub direction: Vector3<f64>,
    /// Covariance of `pixel`, px^2. At infinity: angular covariance across the axis (sideways, upwards) times fx^2.
    pub covariance: Matrix2<f64>,
    /// Indices of the segments that meet here.
    pub inliers: &'a [usize],
    /// Summed length of the inliers, px, less when they are nearly parallel.
    pub score: f64,
    /// Largest angle between two inliers, rad.
    pub spread_rad: f64,
    /// Whether it was found as a direction, because it lies far outside the picture: `direction` is then what to use.
    pub at_infinity: bool,
}

impl VanishingPoint<'_> {
    /// Root of the trace of the covariance, px.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.covariance.trace().max(0.0).sqrt()
    }
}

/// Where the vanishing point is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Expected unit ray along the corridor's axis in the camera's optical frame.
    pub direction: Vector3<f64>,
    /// Standard deviation of its angle, rad, > 0.
    pub sigma_rad: f64,
}

impl Prediction {
    /// The prediction that the vanishing point is at `pixel`, within `sigma_px`.
    #[must_use]
    pub fn at_pixel(pixel: Vector2<f64>, sigma_px: f64, camera: &Intrinsics) -> Self {
        Self { direction: ray(pixel, camera), sigma_rad: sigma_px / camera.fx }
    }
}

/// Why there is no vanishing point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum VanishingPointError {
    /// Fewer segments than a point needs.
    #[error("too few segments: {found}")]
    TooFewSegments {
        /// Segments that may belong to the corridor.
        found: usize,
    },
    /// The lines do not meet in one place.
    #[error("the segments do not meet in one place")]
    NoVanishingPoint,
    /// The lines are nearly parallel in the picture.
    #[error("the segments are nearly parallel")]
    Degenerate,
    /// Two places are equally good, and nothing was predicted.
    #[error("two vanishing points are equally good")]
    Ambiguous,
}

/// Unit ray through a pixel in the optical frame.
fn ray(pixel: Vector2<f64>, camera: &Intrinsics) -> Vector3<f64> {
    let at = camera.normalized_from_pixel(pixel);
    Vector3::new(at.x, at.y, 1.0).normalize()
}

/// The pixel of a ray, clamped to 1e7 px from the principal point.
fn pixel(direction: Vector3<f64>, camera: &Intrinsics) -> Vector2<f64> {
    let limit = 1e7;
    let depth = if direction.z.abs() < 1e-9 { 1e-9_f64.copysign(direction.z) } else { direction.z };
    Vector2::new(
        camera.cx + (camera.fx * direction.x / depth).clamp(-limit, limit),
        camera.cy + (camera.fy * direction.y / depth).clamp(-limit, limit),
    )
}
