//! One tracked edge of the intersection: the height of its templates, and the updates of its landmark.

use nalgebra::Vector2;
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::corridor::observer::CorridorCamera;

use crate::edge_template::{Aim, EdgeTemplate};
use crate::finder::Side;
use crate::landmarks::{Expected, Landmarks};

/// Candidate heights above the floor (m) at which an edge is tracked: the one with the best contrast is used.
const HEIGHTS_M: [f64; 8] = [0.35, 0.6, 0.85, 1.1, 1.35, 1.6, 1.85, 2.1];
/// Ratio of gradients above which another height replaces the current one.
const BETTER_BY: f64 = 1.5;
/// Maximum deviation of an edge at another height from its prediction, pixels at an image width of 640 px.
const SAME_EDGE_AT_640_PX: f64 = 1.25;

/// A tracked edge.
#[derive(Clone, Debug)]
pub struct FollowedEdge {
    template: EdgeTemplate,
    /// Height of the templates above the camera, m.
    above_m: f64,
    /// True if the edge is tracked.
    pub(crate) is_tracked: bool,
    /// Number of consecutive frames in which it was missed.
    pub(crate) misses: u32,
    /// Number of consecutive comparisons in which the wall ended elsewhere.
    pub(crate) elsewhere: u32,
    /// Position in the last image, at the camera's height, undistorted pixels.
    pub(crate) observed_at: Option<Vector2<f64>>,
    /// Reason for which it was missed.
    pub(crate) failure: Option<Reason>,
}

impl FollowedEdge {
    /// Returns an edge that is not tracked yet, for images of this width. Matches must correlate by `min_correlation`, 0 to 1.
    #[must_use]
    pub fn new(image_width: u32, min_correlation: f64) -> Self {
        Self {
            template: EdgeTemplate::new(image_width, min_correlation),
            above_m: 0.0,
            is_tracked: false,
            misses: 0,
            elsewhere: 0,
            observed_at: None,
            failure: None,
        }
    }

    /// Finds the edge, and returns its position at the camera's height, undistorted pixels.
    pub(crate) fn look(
        &mut self,
        image: ImageView<'_>,
        landmarks: &mut Landmarks,
        pose: &Pose2,
        camera: &CorridorCamera,
        side: Side,
    ) -> Result<Vector2<f64>, Reason> {
        let (expected, aim) = aim(landmarks, pose, camera, (side, self.above_m)).ok_or(Reason::Gated)?;
        let edge = self.template.track(image, &aim)?;
        let at = observe(landmarks, pose, camera, side, &expected, Vector2::new(edge.column, aim.pixel.y))?;
        let best = self.best_height(image, landmarks, pose, camera, (side, same_edge_px(image)));
        if let Some((above_m, best_aim, gradient)) = best
            && above_m != self.above_m
            && (gradient > BETTER_BY * edge.gradient || self.leaves(&aim, image))
            && self.template.acquire(image, &best_aim).is_ok()
        {
            self.above_m = above_m;
        }
        Ok(at)
    }

    /// After a miss, takes new templates if the edge is visible at its predicted position, and returns true if so. The edge stays
    /// missed until the next match.
    pub(crate) fn retake(
        &mut self,
        image: ImageView<'_>,
        landmarks: &mut Landmarks,
        pose: &Pose2,
        camera: &CorridorCamera,
        (side, largest_gate_px): (Side, f64),
    ) -> bool {
        let best = self.best_height(image, landmarks, pose, camera, (side, f64::INFINITY));
        let Some((above_m, at, _)) = best.filter(|(_, aim, _)| aim.gate_px < largest_gate_px) else {
            return false;
        };
        let Ok(column) = self.template.acquire(image, &at) else { return false };
        self.above_m = above_m;
        let Some((expected, at)) = aim(landmarks, pose, camera, (side, above_m)) else { return false };
        observe(landmarks, pose, camera, side, &expected, Vector2::new(column, at.pixel.y)).is_ok()
    }

    /// Takes the templates at the height with the best contrast, and returns the edge's position at the camera's height,
    /// undistorted pixels.
    pub(crate) fn take(
        &mut self,
        image: ImageView<'_>,
        landmarks: &mut Landmarks,
        pose: &Pose2,
        camera: &CorridorCamera,
        side: Side,
    ) -> Result<Vector2<f64>, Reason> {
        let best = self.best_height(image, landmarks, pose, camera, (side, same_edge_px(image)));
        let (above_m, aim, _) = best.ok_or(Reason::LowCorrelation)?;
        let at = (side, above_m);
        let expected = landmarks.expected(pose, at, &camera.mount, camera.pinhole.intrinsics());
        let expected = expected.ok_or(Reason::Gated)?;
        let column = self.template.acquire(image, &aim)?;
        self.above_m = above_m;
        observe(landmarks, pose, camera, side, &expected, Vector2::new(column, aim.pixel.y))
    }

    /// Returns the height with the steepest gradient within a lateral tolerance: height above the camera (m), prediction there,
    /// gradient (gray levels per pixel).
    fn best_height(
        &self,
        image: ImageView<'_>,
        landmarks: &Landmarks,
        pose: &Pose2,
        camera: &CorridorCamera,
        (side, max_px): (Side, f64),
    ) -> Option<(f64, Aim, f64)> {
        let fair_px = 0.4 * max_px;
        let at = |height_m: f64| {
            let above_m = height_m - camera.mount.z;
            let (_, aim) = aim(landmarks, pose, camera, (side, above_m))?;
            let aim = Aim { gate_px: aim.gate_px.min(max_px), ..aim };
            let is_inside = !self.leaves(&aim, image);
            let (edge, _) = self.template.edge_at(image, &aim).filter(|_| is_inside)?;
            let aside = (edge.column - aim.pixel.x) / fair_px;
            Some((above_m, aim, edge.gradient, edge.gradient / (1.0 + aside * aside)))
        };
        HEIGHTS_M
            .into_iter()
            .filter_map(at)
            .max_by(|a, b| a.3.total_cmp(&b.3))
            .map(|(above_m, aim, gradient, _)| (above_m, aim, gradient))
    }

    /// Returns true if a template at this prediction extends beyond the image above or below.
    fn leaves(&self, aim: &Aim, image: ImageView<'_>) -> bool {
        let rows = self.template.half_rows();
        aim.pixel.y < rows || aim.pixel.y > image.height() as f64 - 1.0 - rows
    }
}

/// Returns the lateral tolerance at another height, pixels.
fn same_edge_px(image: ImageView<'_>) -> f64 {
    SAME_EDGE_AT_640_PX * image.width() as f64 / 640.0
}

/// Returns the prediction of the edge at a height above the camera.
fn aim(
    landmarks: &Landmarks,
    pose: &Pose2,
    camera: &CorridorCamera,
    at: (Side, f64),
) -> Option<(Expected, Aim)> {
    let expected = landmarks.expected(pose, at, &camera.mount, camera.pinhole.intrinsics())?;
    let aim = Aim {
        pixel: raw(&camera.pinhole, expected.pixel)?,
        gate_px: 3.0 * expected.sigma_px + 2.0,
        depth_m: expected.depth_m,
        lean: expected.lean,
    };
    Some((expected, aim))
}

/// Updates the landmark by a pixel of the edge, and returns its position at the camera's height, undistorted pixels.
fn observe(
    landmarks: &mut Landmarks,
    pose: &Pose2,
    camera: &CorridorCamera,
    side: Side,
    expected: &Expected,
    pixel: Vector2<f64>,
) -> Result<Vector2<f64>, Reason> {
    let at = camera.pinhole.undistort_pixel(pixel).ok_or(Reason::Gated)?;
    let level = landmarks.expected(pose, (side, 0.0), &camera.mount, camera.pinhole.intrinsics());
    let level = level.ok_or(Reason::Gated)?.pixel;
    landmarks.observe_column(expected, at.x);
    Ok(level + Vector2::new(at.x - expected.pixel.x, 0.0))
}

/// Returns the distorted pixel.
pub(crate) fn raw(pinhole: &Pinhole, ideal: Vector2<f64>) -> Option<Vector2<f64>> {
    let ray = pinhole.intrinsics().normalized_from_pixel(ideal).push(1.0);
    pinhole.project(&ray.into()).ok()
}
