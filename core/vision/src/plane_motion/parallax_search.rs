//! Search for a point along its parallax line, in several older pictures at once.
//!
//! Every candidate is a foot ratio w (see [`super::parallax`]): the point F / w is projected into each older picture,
//! and the patches around it are compared. The differences of all baselines are summed on one axis, so that the period
//! of tiles and the aliasing of grain agree on none but the right w: Okutomi & Kanade (1993).

use nalgebra::Vector2;
use yamabico_geometry::Pose2;

use super::candidate_sweep::Sweep;
use super::floor_view::FloorView;
use super::motion_prior::CommonCovariance;
use super::patch_projection::{Planes, Projection};
use super::quad_image::QuadImage;
use crate::vectorize::{self, Kernel};

/// Maximum number of baselines.
pub const MAX_BASELINES: usize = 3;
/// Spacing of the candidates in the picture of the longest baseline, px at a width of 256 px; grows with its root.
const STEP_PX: f64 = 0.7;
/// Reach of the search, px at a width of 256 px; grows with the width.
const REACH_PX: f64 = 12.0;
/// Half the window of the floor, px at a width of 256 px; grows with its root.
const TOLERANCE_PX: f64 = 1.0;
/// Expected cost of the right candidate: samples over the number of them that tell as much as one independent one.
pub const EXPECTED_COST: f32 = 49.0 / 3.0;
/// Maximum number of candidates.
pub(super) const MAX_CANDIDATES: usize = 64;

/// An older picture to compare with.
#[derive(Clone, Copy, Debug)]
pub struct Baseline<'a> {
    /// Picture.
    pub image: &'a QuadImage,
    /// Motion of the robot from it to the current picture, corrected.
    pub motion: Pose2,
}

/// A point to search for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchPoint {
    /// Pixel of the current picture.
    pub pixel: Vector2<f32>,
    /// Displacement along the parallax line that fits as well as one of 1 px across it; see
    /// [`super::gradient_points::GradientPoint::skew`].
    pub skew: f32,
}

/// Best candidates for a point: on the floor, above and below it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchResult {
    /// Costs of the best floor, above and below candidates, like negative log likelihoods; 1e9 for none.
    pub costs: [f32; 3],
    /// Foot ratio of the best candidate above the floor, refined.
    pub ratio: f32,
    /// Standard deviation of `ratio`, that of motion and mount included.
    pub ratio_sigma: f32,
    /// True if that candidate lies at the end of the search.
    pub is_at_end: bool,
    /// True if two baselines by themselves prefer that candidate to the floor, and none contradicts.
    pub is_agreed: bool,
}

/// Search along parallax lines for one camera.
#[derive(Clone, Debug)]
pub struct ParallaxSearch {
    pub(super) step_px: f32,
    /// Candidates on either side of the floor.
    pub(super) half: i32,
    pub(super) tolerance_px: f32,
    pub(super) spacing_px: f32,
}

impl ParallaxSearch {
    /// Creates the search for images of this width, px.
    #[must_use]
    pub fn new(width: u32) -> Self {
        let scale = f64::from(width) / 256.0;
        let step = STEP_PX * scale.sqrt();
        Self {
            step_px: step as f32,
            half: ((REACH_PX * scale / step) as i32).min(MAX_CANDIDATES as i32 / 2 - 1),
            tolerance_px: (TOLERANCE_PX * scale.sqrt()) as f32,
            spacing_px: 1.5 * (0.8 * scale).round().max(1.0) as f32,
        }
    }

    /// Searches for the pixels `points` of `current`, seen by `view`, in the pictures of at most [`MAX_BASELINES`]
    /// baselines, the longest last. `covariance` is that of motion, tilt and roll of the longest; it widens the window
    /// of the floor. Pushes one result for each point; `None` if the geometry allows no comparison.
    pub fn run(
        &self,
        view: &FloorView,
        current: &QuadImage,
        baselines: &[Baseline],
        covariance: &CommonCovariance,
        points: &[SearchPoint],
        results: &mut Vec<Option<SearchResult>>,
    ) {
        results.clear();
        let baselines = &baselines[..baselines.len().min(MAX_BASELINES)];
        let Some(longest) = baselines.last() else { return };
        let mut projections = [Projection::default(); MAX_BASELINES];
        for (projection, baseline) in projections.iter_mut().zip(baselines) {
            *projection = Projection::new(view, baseline, current.mean());
        }
        vectorize::run(Points {
            search: self,
            view,
            motion: longest.motion,
            covariance,
            current,
            baselines,
            projections: &projections[..baselines.len()],
            planes: Planes::new(view),
            points,
            results,
        });
    }
}

/// Points of a picture, to be searched for.
pub(super) struct Points<'a> {
    pub(super) search: &'a ParallaxSearch,
    pub(super) view: &'a FloorView,
    pub(super) motion: Pose2,
    pub(super) covariance: &'a CommonCovariance,
    pub(super) current: &'a QuadImage,
    pub(super) baselines: &'a [Baseline<'a>],
    pub(super) projections: &'a [Projection],
    pub(super) planes: Planes,
    pub(super) points: &'a [SearchPoint],
    pub(super) results: &'a mut Vec<Option<SearchResult>>,
}

impl Kernel for Points<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for point in self.points {
            let result = Sweep::new(&self, *point).map(|mut sweep| sweep.run());
            self.results.push(result);
        }
    }
}
