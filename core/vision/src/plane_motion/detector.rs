//! Judges pictures: alignment, search, classes, and their evidence on the grid.

use nalgebra::{Point2, Vector2};
use thiserror::Error;
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount};
use yamabico_geometry::image::ImageView;

use super::direct_alignment::{Alignment, AlignmentPrior, DirectAligner};
use super::evidence_grid::{EvidenceGrid, OCCUPIED};
use super::floor_view::FloorView;
use super::gradient_points::{GradientPoints, MAX_POINTS};
use super::grid_obstacles::{GridObstacle, ObstacleFinder};
use super::log_odds::CellRules;
use super::look_history::LookHistory;
use super::motion_point::MotionPoint;
use super::motion_prior::motion_prior;
use super::movers::{Mover, MoverTracker};
use super::parallax_search::{Baseline, MAX_BASELINES, ParallaxSearch, SearchResult};
use super::sequential_test::PointClass;

/// Ways between the compared pictures, m.
pub const BASELINES_M: [f64; MAX_BASELINES] = [0.16, 0.32, 0.48];
/// Maximum turn over a baseline, rad.
const MAX_TURN_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Smallest way from one judged picture to the next, m: pictures from the same place repeat the same noise.
const MIN_STEP_M: f64 = 0.008;
/// Factor on the deviation of the turn of baselines that a shorter one has corrected.
const CHAINED_YAW: f64 = 0.35;
/// Inliers from which an alignment corrects the pose.
const MIN_INLIERS: usize = 100;
/// Gain of the slow state of the camera's tilt and roll, for each alignment.
const MOUNT_GAIN: f64 = 0.02;
/// Bound of that state, rad.
const MAX_MOUNT_ERROR: f64 = 1.5 * std::f64::consts::PI / 180.0;
/// Rows below the horizon without points, px at a width of 256 px.
const HORIZON_PX: f64 = 7.0;
/// Slope of a ray below which its floor point is too far.
const MIN_SLOPE: f64 = 0.02;
/// Distance up to which points count on the grid, m.
const RANGE_M: f64 = 4.0;
/// Maximum standard deviation of a thing's distance, m.
const MAX_RANGE_SIGMA_M: f64 = 0.35;
/// Weights of a thing's foot at one standard deviation nearer, at it, and at one farther.
const SPREAD: [(f64, f64); 3] = [(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)];

/// Reason why a picture was not judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotJudged {
    /// The robot stands.
    #[error("the robot has not moved since the last picture")]
    Standstill,
    /// The robot has not yet moved far enough, or has turned.
    #[error("no older picture lies a baseline behind")]
    NoBaseline,
    /// The near floor does not move as one plane.
    #[error("the near floor does not move as one plane")]
    MisRegistered,
    /// The picture has no gradient along parallax lines.
    #[error("the picture has no points")]
    NoFeatures,
}

/// Detects things by plane motion. Allocates for its first pictures only.
#[derive(Clone, Debug)]
pub struct PlaneMotion {
    view: FloorView,
    history: LookHistory,
    aligner: DirectAligner,
    finder: GradientPoints,
    search: ParallaxSearch,
    tilt: f64,
    roll: f64,
    pixels: Vec<Vector2<f32>>,
    found: Vec<Option<SearchResult>>,
    points: Vec<MotionPoint>,
    grid: EvidenceGrid,
    obstacles: ObstacleFinder,
    movers: MoverTracker,
    /// Odometry and time (s) of the last judged picture.
    judged: Option<(Pose2, f64)>,
    alignment: Option<Alignment>,
}

impl PlaneMotion {
    /// Creates a detector for undistorted images of this camera, which must look at the floor ahead.
    #[must_use]
    pub fn new(intrinsics: Intrinsics, mount: Mount) -> Self {
        let view = FloorView::new(intrinsics, mount);
        let (width, height) = (intrinsics.width as usize, intrinsics.height as usize);
        // Alignment reads one row above and below its pixels, and older pictures show the floor higher up.
        let top = (horizon_row(&view).max(0.0) as usize).min(height);
        Self {
            view,
            history: LookHistory::new(width, height, top),
            aligner: DirectAligner::new(view),
            finder: GradientPoints::default(),
            search: ParallaxSearch::new(intrinsics.width),
            tilt: 0.0,
            roll: 0.0,
            pixels: Vec::with_capacity(MAX_POINTS),
            found: Vec::with_capacity(MAX_POINTS),
            points: Vec::with_capacity(MAX_POINTS),
            grid: EvidenceGrid::new(CellRules::default()),
            obstacles: ObstacleFinder::default(),
            movers: MoverTracker::new(view),
            judged: None,
            alignment: None,
        }
    }

    /// Judges a picture taken at `odometry` and the time `at_s` (s), and adds its evidence to the grid.
    ///
    /// # Errors
    /// [`NotJudged`]; the grid then only fades. Pictures of another size are ignored as [`NotJudged::NoFeatures`].
    pub fn look(
        &mut self,
        image: ImageView,
        odometry: Pose2,
        at_s: f64,
    ) -> Result<&[MotionPoint], NotJudged> {
        self.points.clear();
        self.alignment = None;
        let [width, height] = self.view.intrinsics().size();
        if (image.width(), image.height()) != (width as usize, height as usize) || !odometry.is_finite() {
            return Err(NotJudged::NoFeatures);
        }
        self.history.push(image, odometry);
        let before = self.judged.map_or(at_s, |(_, time)| time);
        self.grid.advance(Vector2::new(odometry.x, odometry.y), at_s - before);
        let stands = self.judged.is_some_and(|(last, _)| {
            let step = last.relative(&odometry);
            step.x.hypot(step.y) < MIN_STEP_M
        });
        let pose = self.judged.filter(|_| stands).map_or(odometry, |(last, _)| last);
        self.judged = Some((pose, at_s));
        if stands {
            return Err(NotJudged::Standstill);
        }
        let judged = self.judge(image);
        if judged.is_ok() {
            self.add_to_grid(&odometry);
            self.movers.update(&self.points, &odometry, at_s);
        }
        self.grid.smooth();
        judged.map(|()| self.points.as_slice())
    }

    fn judge(&mut self, image: ImageView) -> Result<(), NotJudged> {
        let mut partners = [(0, Pose2::IDENTITY); MAX_BASELINES];
        let mut count = 0;
        let mut is_misregistered = false;
        for way_m in BASELINES_M {
            let Some(index) = self.history.at_baseline(way_m) else { break };
            if partners[..count].iter().any(|partner| partner.0 == index) {
                continue;
            }
            let Some(aligned) = self.align(index, count > 0) else { break };
            if aligned.is_misregistered() {
                is_misregistered = true;
                continue;
            }
            partners[count] = (index, aligned.motion);
            self.alignment = Some(aligned);
            count += 1;
        }
        let Some(alignment) = self.alignment else {
            return Err(if is_misregistered { NotJudged::MisRegistered } else { NotJudged::NoBaseline });
        };
        self.search(image, &partners[..count], &alignment)
    }

    /// Aligns the newest picture with an older one; `None` if the robot has turned too far.
    fn align(&mut self, index: usize, is_chained: bool) -> Option<Alignment> {
        let (previous, current) = (self.history.look(index), self.history.newest()?);
        // Wheels measure the distance better than images do.
        let wheels = previous.odometry.relative(&current.odometry);
        let corrected = previous.corrected.relative(&current.corrected);
        let motion = Pose2 { x: wheels.x, ..corrected };
        if motion.theta.abs() > MAX_TURN_RAD {
            return None;
        }
        let way_m = motion.x.hypot(motion.y);
        let yaw = if is_chained { CHAINED_YAW } else { 1.0 };
        let prior = AlignmentPrior {
            motion,
            covariance: motion_prior(way_m, motion.theta, yaw),
            tilt: self.tilt,
            roll: self.roll,
        };
        let aligned = self.aligner.align(&current.bands, &previous.bands, &prior);
        if aligned.inliers >= MIN_INLIERS && !aligned.is_misregistered() {
            let corrected = previous.corrected * aligned.motion;
            self.history.correct(corrected);
            let follow = |state: f64, value: f64| {
                (state + MOUNT_GAIN * (value - state)).clamp(-MAX_MOUNT_ERROR, MAX_MOUNT_ERROR)
            };
            (self.tilt, self.roll) = (follow(self.tilt, aligned.tilt), follow(self.roll, aligned.roll));
        }
        Some(aligned)
    }

    fn search(
        &mut self,
        image: ImageView,
        partners: &[(usize, Pose2)],
        alignment: &Alignment,
    ) -> Result<(), NotJudged> {
        let view = self.view.turned(alignment.tilt, alignment.roll);
        let longest = view.camera_motion(&alignment.motion);
        // Place of the older camera in the current one: parallax lines run through its image.
        let older = -longest.rotation.tr_mul(&longest.translation);
        let epipole = view.intrinsics().matrix() * older;
        let scale = image.width() as f64 / 256.0;
        let top = (horizon_row(&view) + HORIZON_PX * scale).max(0.0) as usize;
        let found = self.finder.find(image, epipole, top, view.intrinsics().cy);
        self.pixels.clear();
        let pixels = found.iter().map(|point| Vector2::new(point.u as f32, point.v as f32));
        self.pixels.extend(pixels.filter(|pixel| view.ray(pixel.cast()).z < -MIN_SLOPE));
        let Some(current) = self.history.newest() else { return Err(NotJudged::NoBaseline) };
        if self.pixels.is_empty() {
            return Err(NotJudged::NoFeatures);
        }
        let baseline =
            |&(index, motion): &(usize, Pose2)| Baseline { image: &self.history.look(index).image, motion };
        let first = partners.first().map(baseline).ok_or(NotJudged::NoBaseline)?;
        let mut baselines = [first; MAX_BASELINES];
        for (baseline_of, partner) in baselines.iter_mut().zip(partners) {
            *baseline_of = baseline(partner);
        }
        self.search.run(
            &view,
            &current.image,
            &baselines[..partners.len()],
            &alignment.covariance,
            &self.pixels,
            &mut self.found,
        );
        let camera = Point2::from(view.position().xy());
        for (&pixel, found) in self.pixels.iter().zip(&self.found) {
            if let (Some(found), Some(floor)) = (found, view.floor_point(pixel.cast())) {
                self.points.push(MotionPoint::new(pixel, found, floor, camera, view.position().z));
            }
        }
        Ok(())
    }

    fn add_to_grid(&mut self, odometry: &Pose2) {
        let camera = self.view.position().xy();
        self.grid.begin_picture();
        for point in &self.points {
            let range_m = (point.floor.coords - camera).norm();
            let advantage = point.advantage();
            match point.class {
                PointClass::Floor if range_m < RANGE_M => {
                    self.grid.add_floor(odometry.transform_point(point.floor), advantage);
                }
                PointClass::Below if range_m < RANGE_M => {
                    self.grid.add_below(odometry.transform_point(point.floor), advantage);
                }
                PointClass::Above if point.range_sigma_m < MAX_RANGE_SIGMA_M => {
                    let way = point.foot.coords - camera;
                    let range_m = way.norm();
                    if range_m >= RANGE_M {
                        continue;
                    }
                    for (deviations, weight) in SPREAD {
                        let share = 1.0 + deviations * point.range_sigma_m / range_m.max(0.1);
                        let foot = odometry.transform_point(Point2::from(camera + way * share));
                        self.grid.add_above(foot, advantage, weight);
                    }
                }
                _ => {}
            }
        }
        self.grid.end_picture();
    }

    /// Points of the last picture; none if it was not judged.
    #[must_use]
    pub fn points(&self) -> &[MotionPoint] {
        &self.points
    }

    /// Alignment with the longest baseline of the last picture.
    #[must_use]
    pub fn alignment(&self) -> Option<&Alignment> {
        self.alignment.as_ref()
    }

    /// Evidence around the robot, odometry frame.
    #[must_use]
    pub fn grid(&self) -> &EvidenceGrid {
        &self.grid
    }

    /// Evidence around the robot, for the votes of other sensors.
    pub fn grid_mut(&mut self) -> &mut EvidenceGrid {
        &mut self.grid
    }

    /// Finds the things on the grid as of the last picture, for a robot at `odometry`, from the cells at `counted`
    /// places (odometry frame). The nearest comes first.
    pub fn obstacles(&mut self, odometry: &Pose2, counted: impl Fn(Point2<f64>) -> bool) -> &[GridObstacle] {
        let turn_sigma = self.alignment.map_or(0.0, |alignment| alignment.covariance[(2, 2)].sqrt());
        self.obstacles.find(&self.grid, odometry, OCCUPIED, turn_sigma, counted)
    }

    /// Tracks of things that may walk, odometry frame; see [`Mover::is_confirmed`].
    #[must_use]
    pub fn movers(&self) -> &[Mover] {
        self.movers.tracks()
    }

    /// Estimated tilt and roll of the camera beyond its mount, rad.
    #[must_use]
    pub fn mount_error(&self) -> [f64; 2] {
        [self.tilt, self.roll]
    }

    /// Forgets all pictures and all evidence.
    pub fn clear(&mut self) {
        self.history.clear();
        self.grid.clear();
        self.movers.clear();
        (self.judged, self.alignment) = (None, None);
        self.points.clear();
    }
}

/// Row of the horizon in the middle of the image, px.
fn horizon_row(view: &FloorView) -> f64 {
    let forward = view.robot_from_camera() * nalgebra::Vector3::z();
    let tilt = (-forward.z).asin();
    view.intrinsics().cy - view.intrinsics().fy * tilt.tan()
}
