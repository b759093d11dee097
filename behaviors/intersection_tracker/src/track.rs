//! The two edges followed from picture to picture, as long as they are seen.

use nalgebra::Vector2;
use yamabico_core::camera::Pinhole;
use yamabico_core::corridor::sight::CorridorCamera;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;

use crate::config::Config;
use crate::edge_template::{Aim, EdgeTemplate};
use crate::finder::{Side, WallEnd};
use crate::landmarks::{Expected, Landmarks, Motion};
use crate::pair::bearing;

/// Edges nearer to or farther from each other than this (m) are no corridor's.
const WIDTHS_M: [f64; 2] = [0.5, 8.0];
/// Standard deviation of the distance (m) above which nothing is known.
const LARGEST_SIGMA_M: f64 = 2.0;

/// Heights above the floor (m) at which an edge may be followed: where it is seen best.
const HEIGHTS_M: [f64; 8] = [0.35, 0.6, 0.85, 1.1, 1.35, 1.6, 1.85, 2.1];
/// Another height is taken where the edge is so much steeper there.
const BETTER_BY: f64 = 1.5;
/// Elsewhere along itself an edge that is seen stands no farther from where it must be, pixels of an image 640 px wide.
const SAME_EDGE_AT_640_PX: f64 = 1.25;
/// The end of a wall farther from the edge that is followed is another one, pixels of an image 640 px wide ...
const ELSEWHERE_AT_640_PX: f64 = 1.2;
/// ... if it is so in as many comparisons in a row.
const ELSEWHERE_TIMES: u32 = 2;
/// After a miss an edge is looked for elsewhere along itself only where its column is known so well, pixels of an image 640 px
/// wide ...
const RETAKE_GATE_AT_640_PX: f64 = 5.0;
/// ... or so well where the other one was missed too, and then is found where this one tells.
const RETAKE_FIRST_GATE_AT_640_PX: f64 = 12.0;

/// An edge and how it is seen.
#[derive(Clone, Debug)]
struct Edge {
    template: EdgeTemplate,
    /// Where along it the templates are taken, metres above the camera.
    above_m: f64,
    is_tracked: bool,
    misses: u32,
    /// Comparisons in a row in which the wall ended elsewhere.
    elsewhere: u32,
    seen_at: Option<Vector2<f64>>,
    trouble: Option<Reason>,
}

/// How much of the intersection is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Neither edge.
    None,
    /// This one; where the other must be is worked out.
    One(Side),
    /// Both.
    Both,
}

/// The tracker of one intersection at a time; keeps its buffers from one to the next.
#[derive(Clone, Debug)]
pub struct IntersectionTrack {
    landmarks: Option<Landmarks>,
    edges: [Edge; 2],
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
        let edge = Edge {
            template: EdgeTemplate::new(image_width, config.least_correlation),
            above_m: 0.0,
            is_tracked: false,
            misses: 0,
            elsewhere: 0,
            seen_at: None,
            trouble: None,
        };
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
        match [self.edges[0].is_tracked, self.edges[1].is_tracked] {
            [true, true] => Sides::Both,
            [true, false] => Sides::One(Side::Left),
            [false, true] => Sides::One(Side::Right),
            [false, false] => Sides::None,
        }
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
        self.begun(taken[0].or(taken[1]))
    }

    fn begun(&mut self, taken: Result<(), Reason>) -> Result<(), Reason> {
        if taken.is_err() {
            self.lose();
        }
        taken
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
        let seen = [self.edges[0].seen_at.is_some(), self.edges[1].seen_at.is_some()];
        self.pictures = self.pictures.saturating_add(1);
        match seen {
            [true, true] => Sides::Both,
            [true, false] => Sides::One(Side::Left),
            [false, true] => Sides::One(Side::Right),
            [false, false] => Sides::None,
        }
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
    /// or was missed too often. Gives whether the two agree.
    pub fn reacquire(
        &mut self,
        image: ImageView<'_>,
        pose: &Pose2,
        camera: &CorridorCamera,
        end: &WallEnd,
    ) -> bool {
        let Some(landmarks) = &mut self.landmarks else { return false };
        if !landmarks.observe_point(pose, end.side, end.point_in_robot, &end.covariance) {
            return false;
        }
        let edge = &self.edges[end.side.index()];
        let is_wanted = !edge.is_tracked || edge.misses >= self.reacquire_misses;
        !is_wanted || self.acquire(image, pose, camera, end).is_ok()
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

impl Edge {
    /// Looks for the edge; gives its place at the camera's height, undistorted pixels.
    fn look(
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

    /// After a miss: takes the templates anew where the edge is still seen just where it must be, for the landmarks too; gives
    /// whether it is. It stays missed until the next picture matches.
    fn retake(
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

    /// Takes the templates where the edge is seen best; gives its place at the camera's height, undistorted pixels.
    fn take(
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

    /// Where along the edge it is steepest, no farther aside than so many pixels: metres above the camera, the aim there, grey
    /// levels a pixel.
    fn best_height(
        &self,
        image: ImageView<'_>,
        landmarks: &Landmarks,
        pose: &Pose2,
        camera: &CorridorCamera,
        (side, most_px): (Side, f64),
    ) -> Option<(f64, Aim, f64)> {
        let fair_px = 0.4 * most_px;
        let at = |height_m: f64| {
            let above_m = height_m - camera.mount.z;
            let (_, aim) = aim(landmarks, pose, camera, (side, above_m))?;
            let aim = Aim { gate_px: aim.gate_px.min(most_px), ..aim };
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

    /// Whether a template at this aim reaches out of the picture above or below.
    fn leaves(&self, aim: &Aim, image: ImageView<'_>) -> bool {
        let rows = self.template.half_rows();
        aim.pixel.y < rows || aim.pixel.y > image.height() as f64 - 1.0 - rows
    }
}

/// How far aside (px) an edge may be seen elsewhere along itself.
fn same_edge_px(image: ImageView<'_>) -> f64 {
    SAME_EDGE_AT_640_PX * image.width() as f64 / 640.0
}

/// Where the edge is expected, some height above the camera.
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

/// Takes a pixel of the picture as the edge; gives its place at the camera's height, undistorted pixels.
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

/// The pixel as the lens shows it.
fn raw(pinhole: &Pinhole, ideal: Vector2<f64>) -> Option<Vector2<f64>> {
    let ray = pinhole.intrinsics().normalised_from_pixel(ideal).push(1.0);
    pinhole.project(&ray.into()).ok()
}
