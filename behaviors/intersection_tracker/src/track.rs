//! Tracker of the two edges of an intersection from frame to frame.

use nalgebra::Vector2;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::corridor::observer::CorridorCamera;

use crate::config::Config;
use crate::finder::{Side, WallEnd};
use crate::followed_edge::{FollowedEdge, raw};
use crate::landmarks::{Landmarks, Motion};
use crate::pair::bearing;

/// Minimum and maximum distance between the two edges of a corridor, m.
const WIDTHS_M: [f64; 2] = [0.5, 8.0];
/// Standard deviation of the distance above which the intersection is lost, m.
const LARGEST_SIGMA_M: f64 = 2.0;
/// Distance above which the end of a wall contradicts the tracked edge, pixels at an image width of 640 px.
const ELSEWHERE_AT_640_PX: f64 = 1.2;
/// Number of consecutive contradictions after which the edge is replaced.
const ELSEWHERE_TIMES: u32 = 2;
/// Maximum standard deviation of the predicted column for a search at another height after a miss, pixels at an image width
/// of 640 px.
const RETAKE_GATE_AT_640_PX: f64 = 5.0;
/// The same if both edges were missed.
const RETAKE_FIRST_GATE_AT_640_PX: f64 = 12.0;

/// The edges that are observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Neither edge.
    None,
    /// One of them; the other one is predicted.
    One,
    /// Both.
    Both,
}

impl Sides {
    fn of(seen: [bool; 2]) -> Self {
        match seen {
            [true, true] => Sides::Both,
            [false, false] => Sides::None,
            _ => Sides::One,
        }
    }
}

/// Tracker of one intersection at a time. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct IntersectionTrack {
    landmarks: Option<Landmarks>,
    edges: [FollowedEdge; 2],
    confirmations: u32,
    contradictions: u32,
    frames: u32,
    reacquire_misses: u32,
    lost_misses: u32,
    border_px: f64,
}

impl IntersectionTrack {
    /// Returns a tracker without an intersection, for images of this width.
    #[must_use]
    pub fn new(image_width: u32, config: &Config) -> Self {
        let edge = FollowedEdge::new(image_width, config.min_correlation);
        Self {
            landmarks: None,
            edges: [edge.clone(), edge],
            confirmations: 0,
            contradictions: 0,
            frames: 0,
            reacquire_misses: config.reacquire_misses,
            lost_misses: config.lost_misses,
            border_px: config.border_px,
        }
    }

    /// Returns the estimated positions of the edges; `None` while nothing is tracked.
    #[must_use]
    pub fn landmarks(&self) -> Option<&Landmarks> {
        self.landmarks.as_ref()
    }

    /// Returns the number of frames in which both walls ended at the edges.
    #[must_use]
    pub fn confirmations(&self) -> u32 {
        self.confirmations
    }

    /// Returns the number of frames since the start of the track.
    #[must_use]
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Counts a frame in which both walls end at the edges.
    pub fn confirm(&mut self) {
        self.confirmations = self.confirmations.saturating_add(1);
        self.contradictions = 0;
    }

    /// Counts a frame in which the walls end elsewhere, and returns the number of consecutive ones.
    pub fn contradict(&mut self) -> u32 {
        self.contradictions = self.contradictions.saturating_add(1);
        self.contradictions
    }

    /// Returns true if the ends of the walls in one image, taken from `pose`, agree with the edges.
    #[must_use]
    pub fn agrees(&self, pose: &Pose2, ends: &[WallEnd; 2]) -> bool {
        self.landmarks.is_some_and(|landmarks| {
            ends.iter().all(|end| landmarks.agrees(pose, end.side, end.point_in_robot, &end.covariance))
        })
    }

    /// Returns the edges that are tracked.
    #[must_use]
    pub fn sides(&self) -> Sides {
        Sides::of([self.edges[0].is_tracked, self.edges[1].is_tracked])
    }

    /// Returns the position of an edge in the last image, at the camera's height, undistorted pixels.
    #[must_use]
    pub fn observed_at(&self, side: Side) -> Option<Vector2<f64>> {
        self.edges[side.index()].observed_at
    }

    /// Returns the reason for which an edge was missed in the last image.
    #[must_use]
    pub fn failure(&self, side: Side) -> Option<Reason> {
        self.edges[side.index()].failure
    }

    /// Returns true if an edge is not tracked, or was missed so often that it must be found again among the ends of the walls.
    #[must_use]
    pub fn needs_ends(&self) -> bool {
        self.edges.iter().any(|edge| !edge.is_tracked || edge.misses >= self.reacquire_misses)
    }

    /// Drops the intersection.
    pub fn lose(&mut self) {
        self.landmarks = None;
        (self.confirmations, self.contradictions, self.frames) = (0, 0, 0);
        for edge in &mut self.edges {
            (edge.is_tracked, edge.misses, edge.elsewhere) = (false, 0, 0);
            (edge.observed_at, edge.failure) = (None, None);
        }
    }

    /// Starts a track with the ends of both walls, observed from `pose`.
    ///
    /// # Errors
    /// The reason for which neither edge can be tracked.
    pub fn begin_pair(
        &mut self,
        image: ImageView<'_>,
        pose: &Pose2,
        camera: &CorridorCamera,
        ends: &[WallEnd; 2],
    ) -> Result<(), Reason> {
        self.lose();
        let points = [ends[0].point_in_robot, ends[1].point_in_robot];
        self.landmarks = Some(Landmarks::new(pose, points, [ends[0].covariance, ends[1].covariance]));
        let taken = [0, 1].map(|i| self.acquire(image, pose, camera, &ends[i]));
        self.confirmations = u32::from(taken[0].is_ok() && taken[1].is_ok());
        let begun = taken[0].or(taken[1]);
        if begun.is_err() {
            self.lose();
        }
        begun
    }

    /// Propagates the state to the next frame.
    pub fn predict(&mut self, motion: Motion) {
        if let Some(landmarks) = &mut self.landmarks {
            landmarks.predict(motion);
        }
    }

    /// Returns true if the intersection is so near, or so far aside, that an edge leaves the image.
    #[must_use]
    pub fn leaves_image(&self, pose: &Pose2, camera: &CorridorCamera) -> bool {
        let Some(landmarks) = &self.landmarks else { return false };
        let width = f64::from(camera.pinhole.intrinsics().width);
        Side::BOTH.into_iter().any(|side| {
            let at = landmarks.expected(pose, (side, 0.0), &camera.mount, camera.pinhole.intrinsics());
            at.and_then(|at| raw(&camera.pinhole, at.pixel))
                .is_none_or(|pixel| pixel.x < self.border_px || pixel.x > width - 1.0 - self.border_px)
        })
    }

    /// Searches for both edges in an image taken from `pose`, and returns those observed.
    pub fn follow(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera) -> Sides {
        let Some(landmarks) = &mut self.landmarks else { return Sides::None };
        for side in Side::BOTH {
            let edge = &mut self.edges[side.index()];
            edge.observed_at = None;
            if !edge.is_tracked {
                continue;
            }
            match edge.look(image, landmarks, pose, camera, side) {
                Ok(column) => (edge.observed_at, edge.misses, edge.failure) = (Some(column), 0, None),
                Err(reason) => {
                    edge.misses += 1;
                    edge.failure = Some(reason);
                }
            }
        }
        self.retake_missed(image, pose, camera);
        self.frames = self.frames.saturating_add(1);
        Sides::of([self.edges[0].observed_at.is_some(), self.edges[1].observed_at.is_some()])
    }

    /// Takes new templates for missed edges at their predicted positions.
    fn retake_missed(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera) {
        let Some(mut landmarks) = self.landmarks else { return };
        let scale = image.width() as f64 / 640.0;
        let is_alone = self.edges.iter().all(|edge| edge.observed_at.is_none());
        let mut gate_px = scale * if is_alone { RETAKE_FIRST_GATE_AT_640_PX } else { RETAKE_GATE_AT_640_PX };
        for side in Side::BOTH {
            let edge = &mut self.edges[side.index()];
            if edge.is_tracked
                && edge.observed_at.is_none()
                && edge.retake(image, &mut landmarks, pose, camera, (side, gate_px))
            {
                gate_px = scale * RETAKE_GATE_AT_640_PX;
            }
        }
    }

    /// Updates the distance of an edge by the end of its wall, and starts to track the end if the edge is not tracked or was
    /// missed too often. An end elsewhere has no effect.
    pub fn reacquire(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera, end: &WallEnd) {
        let Some(landmarks) = &mut self.landmarks else { return };
        let is_there = landmarks.observe_point(pose, end.side, end.point_in_robot, &end.covariance);
        let edge = &self.edges[end.side.index()];
        if is_there && (!edge.is_tracked || edge.misses >= self.reacquire_misses) {
            // An edge without a template stays missed.
            let _ = self.acquire(image, pose, camera, end);
        }
    }

    /// Compares an observed edge with the end of its wall in the same image. After repeated contradictions the end replaces
    /// the edge.
    pub fn correct(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera, end: &WallEnd) {
        let edge = &mut self.edges[end.side.index()];
        let (Some(landmarks), Some(seen_at)) = (&mut self.landmarks, edge.observed_at) else { return };
        let (intrinsics, mount) = (camera.pinhole.intrinsics(), &camera.mount);
        let from_camera = end.point_in_robot - Vector2::new(mount.x, mount.y);
        let aside_rad = from_camera.y.atan2(from_camera.x) - bearing(seen_at, intrinsics, mount);
        let elsewhere_px = ELSEWHERE_AT_640_PX * image.width() as f64 / 640.0;
        if (aside_rad * intrinsics.fx).abs() < elsewhere_px {
            edge.elsewhere = 0;
            return;
        }
        edge.elsewhere += 1;
        if edge.elsewhere >= ELSEWHERE_TIMES {
            edge.elsewhere = 0;
            landmarks.place(pose, end.side, end.point_in_robot, &end.covariance);
            // An edge without a template stays missed, and is found again among the ends of the walls.
            if self.acquire(image, pose, camera, end).is_err() {
                self.edges[end.side.index()].misses = self.reacquire_misses;
            }
        }
    }

    /// Drops edges that were missed too often, and the intersection if no edge is left or the two cannot belong to one
    /// corridor. Returns true if the intersection is lost.
    pub fn drop_lost(&mut self, pose: &Pose2) -> bool {
        let Some(landmarks) = &self.landmarks else { return false };
        for edge in &mut self.edges {
            edge.is_tracked &= edge.misses < self.lost_misses;
        }
        let width_m = (landmarks.point(Side::Left) - landmarks.point(Side::Right)).norm();
        let (_, sigma_m) = landmarks.middle(pose);
        let is_sane = (WIDTHS_M[0]..=WIDTHS_M[1]).contains(&width_m) && sigma_m < LARGEST_SIGMA_M;
        let is_lost = self.sides() == Sides::None || !is_sane;
        if is_lost {
            self.lose();
        }
        is_lost
    }

    fn acquire(
        &mut self,
        image: ImageView<'_>,
        pose: &Pose2,
        camera: &CorridorCamera,
        end: &WallEnd,
    ) -> Result<(), Reason> {
        let Some(landmarks) = &mut self.landmarks else { return Err(Reason::IntersectionLost) };
        let edge = &mut self.edges[end.side.index()];
        let taken = edge.take(image, landmarks, pose, camera, end.side);
        edge.failure = taken.err();
        let at = taken?;
        (edge.is_tracked, edge.misses, edge.observed_at) = (true, 0, Some(at));
        Ok(())
    }
}
