//! The two edges followed from picture to picture, as long as they are seen.

use nalgebra::Vector2;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::corridor::sight::CorridorCamera;

use crate::config::Config;
use crate::finder::{Side, WallEnd};
use crate::followed_edge::{FollowedEdge, raw};
use crate::landmarks::{Landmarks, Motion};
use crate::pair::bearing;

/// Edges nearer to or farther from each other than this (m) are no corridor's.
const WIDTHS_M: [f64; 2] = [0.5, 8.0];
/// Standard deviation of the distance (m) above which nothing is known.
const LARGEST_SIGMA_M: f64 = 2.0;
/// The end of a wall farther from the edge that is followed is another one, pixels of an image 640 px wide ...
const ELSEWHERE_AT_640_PX: f64 = 1.2;
/// ... if it is so in as many comparisons in a row.
const ELSEWHERE_TIMES: u32 = 2;
/// After a miss an edge is looked for elsewhere along itself only where its column is known so well, pixels of an image 640 px
/// wide ...
const RETAKE_GATE_AT_640_PX: f64 = 5.0;
/// ... or so well where the other one was missed too, and then is found where this one tells.
const RETAKE_FIRST_GATE_AT_640_PX: f64 = 12.0;

/// How much of the intersection is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Neither edge.
    None,
    /// One of them; where the other must be is worked out.
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

/// The tracker of one intersection at a time; keeps its buffers from one to the next.
#[derive(Clone, Debug)]
pub struct IntersectionTrack {
    landmarks: Option<Landmarks>,
    edges: [FollowedEdge; 2],
    confirmations: u32,
    contradictions: u32,
    pictures: u32,
    reacquire_misses: u32,
    lost_misses: u32,
    border_px: f64,
}

impl IntersectionTrack {
    /// Nothing tracked yet, for pictures of this width.
    #[must_use]
    pub fn new(image_width: u32, config: &Config) -> Self {
        let edge = FollowedEdge::new(image_width, config.min_correlation);
        Self {
            landmarks: None,
            edges: [edge.clone(), edge],
            confirmations: 0,
            contradictions: 0,
            pictures: 0,
            reacquire_misses: config.reacquire_misses,
            lost_misses: config.lost_misses,
            border_px: config.border_px,
        }
    }

    /// The edges' places; `None` while nothing is tracked.
    #[must_use]
    pub fn landmarks(&self) -> Option<&Landmarks> {
        self.landmarks.as_ref()
    }

    /// Pictures in which both walls were found to end where the edges are.
    #[must_use]
    pub fn confirmations(&self) -> u32 {
        self.confirmations
    }

    /// Pictures since the beginning.
    #[must_use]
    pub fn pictures(&self) -> u32 {
        self.pictures
    }

    /// Counts a picture in which both walls end where the edges are.
    pub fn confirm(&mut self) {
        self.confirmations = self.confirmations.saturating_add(1);
        self.contradictions = 0;
    }

    /// Counts a picture in which the walls end elsewhere; gives how many there were in a row.
    pub fn contradict(&mut self) -> u32 {
        self.contradictions = self.contradictions.saturating_add(1);
        self.contradictions
    }

    /// Whether the walls end, by one picture alone taken from `pose`, where the edges are.
    #[must_use]
    pub fn agrees(&self, pose: &Pose2, ends: &[WallEnd; 2]) -> bool {
        self.landmarks.is_some_and(|landmarks| {
            ends.iter().all(|end| landmarks.agrees(pose, end.side, end.point_in_robot, &end.covariance))
        })
    }

    /// Which edges are followed.
    #[must_use]
    pub fn sides(&self) -> Sides {
        Sides::of([self.edges[0].is_tracked, self.edges[1].is_tracked])
    }

    /// Where an edge was seen in the last picture, at the camera's height, undistorted pixels.
    #[must_use]
    pub fn seen_at(&self, side: Side) -> Option<Vector2<f64>> {
        self.edges[side.index()].seen_at
    }

    /// Why an edge was not seen in the last picture.
    #[must_use]
    pub fn trouble(&self, side: Side) -> Option<Reason> {
        self.edges[side.index()].trouble
    }

    /// Whether an edge is not followed, or was missed so often that it has to be looked for among the ends of the walls.
    #[must_use]
    pub fn needs_ends(&self) -> bool {
        self.edges.iter().any(|edge| !edge.is_tracked || edge.misses >= self.reacquire_misses)
    }

    /// Forgets everything.
    pub fn lose(&mut self) {
        self.landmarks = None;
        (self.confirmations, self.contradictions, self.pictures) = (0, 0, 0);
        for edge in &mut self.edges {
            (edge.is_tracked, edge.misses, edge.elsewhere) = (false, 0, 0);
            (edge.seen_at, edge.trouble) = (None, None);
        }
    }

    /// Begins with the ends of both walls, seen from a robot at `pose`.
    ///
    /// # Errors
    /// Why neither edge can be followed.
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

    /// Carries what is known to the next picture.
    pub fn predict(&mut self, motion: Motion) {
        if let Some(landmarks) = &mut self.landmarks {
            landmarks.predict(motion);
        }
    }

    /// Whether the intersection is so near, or so far aside, that an edge leaves the picture.
    #[must_use]
    pub fn leaves_picture(&self, pose: &Pose2, camera: &CorridorCamera) -> bool {
        let Some(landmarks) = &self.landmarks else { return false };
        let width = f64::from(camera.pinhole.intrinsics().width);
        Side::BOTH.into_iter().any(|side| {
            let at = landmarks.expected(pose, (side, 0.0), &camera.mount, camera.pinhole.intrinsics());
            at.and_then(|at| raw(&camera.pinhole, at.pixel))
                .is_none_or(|pixel| pixel.x < self.border_px || pixel.x > width - 1.0 - self.border_px)
        })
    }

    /// Looks for both edges in a picture taken from `pose`; gives which were seen in it.
    pub fn follow(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera) -> Sides {
        let Some(landmarks) = &mut self.landmarks else { return Sides::None };
        for side in Side::BOTH {
            let edge = &mut self.edges[side.index()];
            edge.seen_at = None;
            if !edge.is_tracked {
                continue;
            }
            match edge.look(image, landmarks, pose, camera, side) {
                Ok(column) => (edge.seen_at, edge.misses, edge.trouble) = (Some(column), 0, None),
                Err(reason) => {
                    edge.misses += 1;
                    edge.trouble = Some(reason);
                }
            }
        }
        self.retake_missed(image, pose, camera);
        self.pictures = self.pictures.saturating_add(1);
        Sides::of([self.edges[0].seen_at.is_some(), self.edges[1].seen_at.is_some()])
    }

    /// Takes the templates of edges that were missed anew, each where the others tell that it must be.
    fn retake_missed(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera) {
        let Some(mut landmarks) = self.landmarks else { return };
        let scale = image.width() as f64 / 640.0;
        let is_alone = self.edges.iter().all(|edge| edge.seen_at.is_none());
        let mut gate_px = scale * if is_alone { RETAKE_FIRST_GATE_AT_640_PX } else { RETAKE_GATE_AT_640_PX };
        for side in Side::BOTH {
            let edge = &mut self.edges[side.index()];
            if edge.is_tracked
                && edge.seen_at.is_none()
                && edge.retake(image, &mut landmarks, pose, camera, (side, gate_px))
            {
                gate_px = scale * RETAKE_GATE_AT_640_PX;
            }
        }
    }

    /// Takes where the end of a wall stands for the distance of its edge, and the end for the edge where that is not followed
    /// or was missed too often; an end that stands elsewhere changes nothing.
    pub fn reacquire(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera, end: &WallEnd) {
        let Some(landmarks) = &mut self.landmarks else { return };
        let is_there = landmarks.observe_point(pose, end.side, end.point_in_robot, &end.covariance);
        let edge = &self.edges[end.side.index()];
        if is_there && (!edge.is_tracked || edge.misses >= self.reacquire_misses) {
            // What cannot be taken stays missed.
            let _ = self.acquire(image, pose, camera, end);
        }
    }

    /// Compares an edge that was seen with the end of its wall, found in the same picture; where the wall ended elsewhere again
    /// and again, the edge is that of something else, and the end is taken instead.
    pub fn correct(&mut self, image: ImageView<'_>, pose: &Pose2, camera: &CorridorCamera, end: &WallEnd) {
        let edge = &mut self.edges[end.side.index()];
        let (Some(landmarks), Some(seen_at)) = (&mut self.landmarks, edge.seen_at) else { return };
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
            // What cannot be taken stays missed, and is looked for among the ends of the walls.
            if self.acquire(image, pose, camera, end).is_err() {
                self.edges[end.side.index()].misses = self.reacquire_misses;
            }
        }
    }

    /// Drops edges that were missed too often, and everything where no edge is left or the two are no corridor's; gives
    /// whether the intersection is lost.
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
        edge.trouble = taken.err();
        let at = taken?;
        (edge.is_tracked, edge.misses, edge.seen_at) = (true, 0, Some(at));
        Ok(())
    }
}
