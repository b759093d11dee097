//! Judges the points of one picture after the other: alignment, search along parallax lines, classes.

use nalgebra::{Point2, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::{Distortion, Intrinsics, Mount, Pinhole};
use yamabico_geometry::image::ImageView;
use yamabico_geometry::{Hypotenuse, Pose2};

use super::direct_alignment::{Alignment, AlignmentPrior, DirectAligner};
use super::floor_view::FloorView;
use super::gradient_points::{GradientPoints, MAX_POINTS};
use super::look_history::LookHistory;
use super::motion_point::MotionPoint;
use super::motion_prior::{lag_covariance, motion_prior};
use super::parallax_search::{Baseline, MAX_BASELINES, ParallaxSearch, SearchPoint, SearchResult};
use super::wheel_lag::WheelLag;

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

/// Reason why a picture was not judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotJudged {
    /// The robot stands.
    #[error("the robot has not moved since the last picture")]
    Standstill,
    /// The robot speeds up or brakes so hard that it nods.
    #[error("the robot speeds up or brakes hard")]
    Unsteady,
    /// The robot has not yet moved far enough, or has turned.
    #[error("no older picture lies a baseline behind")]
    NoBaseline,
    /// The near floor does not move as one plane.
    #[error("the near floor does not move as one plane")]
    MisRegistered,
    /// The picture has no gradient along parallax lines, or another size than the camera.
    #[error("the picture has no points")]
    NoFeatures,
}

/// Judges pictures. It remembers older pictures, but no evidence. Allocates when it is created and for its first
/// picture.
#[derive(Clone, Debug)]
pub struct PictureJudge {
    view: FloorView,
    history: LookHistory,
    lag: WheelLag,
    aligner: DirectAligner,
    finder: GradientPoints,
    search: ParallaxSearch,
    tilt: f64,
    roll: f64,
    pixels: Vec<SearchPoint>,
    found: Vec<Option<SearchResult>>,
    points: Vec<MotionPoint>,
    /// Odometry of the last picture that was not taken at standstill.
    moved: Option<Pose2>,
    alignment: Option<Alignment>,
    /// Number of older pictures that the last one was compared with.
    baselines: usize,
}

impl PictureJudge {
    /// Creates a judge for undistorted images of this camera, which must look at the floor ahead.
    #[must_use]
    pub fn new(intrinsics: Intrinsics, mount: Mount) -> Self {
        let view = FloorView::new(intrinsics, mount);
        let (width, height) = (intrinsics.width as usize, intrinsics.height as usize);
        // Alignment reads one row above and below its pixels, and older pictures show the floor higher up.
        let top = (horizon_row(&view).max(0.0) as usize).min(height);
        Self {
            view,
            history: LookHistory::new(width, height, top),
            lag: WheelLag::default(),
            aligner: DirectAligner::new(view),
            finder: GradientPoints::default(),
            search: ParallaxSearch::new(intrinsics.width),
            tilt: 0.0,
            roll: 0.0,
            pixels: Vec::with_capacity(MAX_POINTS),
            found: Vec::with_capacity(MAX_POINTS),
            points: Vec::with_capacity(MAX_POINTS),
            moved: None,
            alignment: None,
            baselines: 0,
        }
    }

    /// Creates a judge for a camera; `None` if its lens distorts, or its height above the floor is unknown.
    #[must_use]
    pub fn of_camera(pinhole: &Pinhole, mount: Mount) -> Option<Self> {
        let is_usable = *pinhole.distortion() == Distortion::NONE && mount.z > 0.0;
        is_usable.then(|| Self::new(*pinhole.intrinsics(), mount))
    }

    /// Judges the points of a picture taken at `odometry` and the time `at_s` (s), in any order; at most
    /// [`MAX_POINTS`].
    ///
    /// Points are in the robot frame at the capture; [`PictureJudge::pose`] is its pose.
    ///
    /// # Errors
    /// [`NotJudged`]: the picture says nothing. Pictures of another size are ignored as [`NotJudged::NoFeatures`].
    pub fn judge(
        &mut self,
        image: ImageView,
        odometry: Pose2,
        at_s: f64,
    ) -> Result<&[MotionPoint], NotJudged> {
        self.points.clear();
        (self.alignment, self.baselines) = (None, 0);
        let [width, height] = self.view.intrinsics().size();
        if (image.width(), image.height()) != (width as usize, height as usize) || !odometry.is_finite() {
            return Err(NotJudged::NoFeatures);
        }
        self.history.push(image, odometry, at_s, &self.lag);
        let stands = self.moved.is_some_and(|last| {
            let step = last.relative(&odometry);
            step.x.hypotenuse(step.y) < MIN_STEP_M
        });
        if !stands {
            self.moved = Some(odometry);
        }
        let mut partners = [(0, Pose2::IDENTITY); MAX_BASELINES];
        let aligned = self.align_baselines(stands, &mut partners);
        let count = aligned?;
        let Some(alignment) = self.alignment else { return Err(NotJudged::NoBaseline) };
        self.search(image, &partners[..count], &alignment)?;
        self.baselines = count;
        Ok(&self.points)
    }

    /// Aligns the newest picture with those a baseline behind; returns their number. Without them, the picture before
    /// corrects the pose.
    fn align_baselines(
        &mut self,
        stands: bool,
        partners: &mut [(usize, Pose2); MAX_BASELINES],
    ) -> Result<usize, NotJudged> {
        let is_steady = self.history.newest().is_some_and(|look| look.is_steady);
        let (mut count, mut is_misregistered) = (0, false);
        if is_steady && !stands {
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
        }
        if count > 0 {
            return Ok(count);
        }
        if let Some(index) = self.history.before_newest() {
            self.align(index, false);
        }
        Err(if stands {
            NotJudged::Standstill
        } else if !is_steady {
            NotJudged::Unsteady
        } else if is_misregistered {
            NotJudged::MisRegistered
        } else {
            NotJudged::NoBaseline
        })
    }

    /// Aligns the newest picture with an older one; `None` if the robot has turned too far.
    fn align(&mut self, index: usize, is_chained: bool) -> Option<Alignment> {
        let (previous, current) = (self.history.look(index), self.history.newest()?);
        // Wheels measure the distance better than images do.
        let wheels = previous.led(&self.lag).relative(&current.led(&self.lag));
        let corrected = previous.corrected.relative(&current.corrected);
        let motion = Pose2 { x: wheels.x, ..corrected };
        if motion.theta.abs() > MAX_TURN_RAD {
            return None;
        }
        let way_m = motion.x.hypotenuse(motion.y);
        let change = Vector2::new(
            current.twist.linear - previous.twist.linear,
            current.twist.angular - previous.twist.angular,
        );
        let yaw = if is_chained { CHAINED_YAW } else { 1.0 };
        let prior = AlignmentPrior {
            motion,
            covariance: motion_prior(way_m, motion.theta, yaw)
                + lag_covariance(self.lag.sigma_s(), change, way_m),
            tilt: self.tilt,
            roll: self.roll,
        };
        let aligned = self.aligner.align(&current.bands, &previous.bands, &prior);
        if aligned.inliers >= MIN_INLIERS && !aligned.is_misregistered() {
            let corrected = previous.corrected * aligned.motion;
            let raw = previous.odometry.relative(&current.odometry);
            self.lag.learn(&raw, &aligned.motion, change);
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
        let pixels = found.iter().map(|point| SearchPoint {
            pixel: Vector2::new(point.u as f32, point.v as f32),
            skew: point.skew,
        });
        self.pixels.extend(pixels.filter(|point| view.ray(point.pixel.cast()).z < -MIN_SLOPE));
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
        for (SearchPoint { pixel, .. }, found) in self.pixels.iter().zip(&self.found) {
            if let (Some(found), Some(floor)) = (found, view.floor_point(pixel.cast())) {
                self.points.push(MotionPoint::new(*pixel, found, floor, camera, view.position().z));
            }
        }
        Ok(())
    }

    /// View of the camera at its mount.
    #[must_use]
    pub fn view(&self) -> &FloorView {
        &self.view
    }

    /// Points of the last picture; none if it was not judged.
    #[must_use]
    pub fn points(&self) -> &[MotionPoint] {
        &self.points
    }

    /// Pose at the last picture in the odometry frame, without the lag of the wheels.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        self.history.newest().map_or(Pose2::IDENTITY, |look| look.led(&self.lag))
    }

    /// Lag of the wheels behind the pictures.
    #[must_use]
    pub fn wheel_lag(&self) -> &WheelLag {
        &self.lag
    }

    /// Alignment with the longest baseline of the last picture.
    #[must_use]
    pub fn alignment(&self) -> Option<&Alignment> {
        self.alignment.as_ref()
    }

    /// True if the last picture was compared with two older ones or more: one alone shows no things.
    #[must_use]
    pub fn shows_things(&self) -> bool {
        self.baselines >= 2
    }

    /// Estimated tilt and roll of the camera beyond its mount, rad.
    #[must_use]
    pub fn mount_error(&self) -> [f64; 2] {
        [self.tilt, self.roll]
    }

    /// Forgets all pictures.
    pub fn clear(&mut self) {
        self.history.clear();
        (self.moved, self.alignment) = (None, None);
        self.points.clear();
    }
}

/// Row of the horizon in the middle of the image, px.
fn horizon_row(view: &FloorView) -> f64 {
    let forward = view.robot_from_camera() * Vector3::z();
    let tilt = (-forward.z).asin();
    view.intrinsics().cy - view.intrinsics().fy * tilt.tan()
}
