//! Pose tracking: dead reckoning, retroactive corrections by images, and the search for a lost pose.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{FrameHeader, Odometry, PoseStatus, Reason, View};
use yamabico_core::sensor::Robot;
use yamabico_core::time::Time;

use crate::agreement::{Agreement, agree};
use crate::belief::{Belief, difference};
use crate::config::Config;
use crate::finder::Finder;
use crate::fix::{Fix, NoiseFactors};
use crate::health::{Advice, Health, INFLATION};
use crate::history::{CAPACITY, History, HistoryError};
use crate::look_around::LookAround;
use crate::motion::Increment;

/// Minimum variances of (x, y, theta) after a fix, m², m², rad²: (5 mm)², (5 mm)², (0.1 deg)².
const MIN_VARIANCES: [f64; 3] = [25e-6, 25e-6, 3.046e-6];
/// Distance (m) and squared Mahalanobis distance above which a correction must be confirmed by the next image.
const LARGE_CORRECTION: (f64, f64) = (0.5, 14.16);
/// Distance driven that decorrelates two images as much as a turn by 1 rad, m.
const TURN_M: f64 = 0.5;
/// Maximum factor on the variance of images that are correlated with the previous fix.
const MAX_CORRELATION: f64 = 50.0;
/// Ratio of the numbers of matched lines from which another pose is superior to a weak fix.
const SUPERIOR: f64 = 1.25;
/// Matched fraction of the expected features below which a weak fix is doubtful, although no other pose is superior.
const DOUBTFUL: f64 = 0.5;
/// Standard deviations of position (m) and heading (rad) that each image adds after several without a fix, and their
/// maximum sums: edges are expected but not found where the pose says.
const DOUBT_SIGMAS: (f64, f64) = (0.02, 0.0175);
const MAX_DOUBT_SIGMAS: (f64, f64) = (0.2, 0.1);
/// Multiple of the robot's maximum speed above which odometry counts as a jump.
const JUMP_FACTOR: f64 = 3.0;
/// Standard deviations of position (m) and heading (rad) added by a jump of the odometry.
const JUMP_SIGMA: (f64, f64) = (0.1, 0.1);

/// Saved state of a [`Tracker`], restored after a restart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseState {
    /// Time of the newest odometry.
    stamp: Time,
    /// Odometry pose at this time.
    odometry: Pose2,
    /// Robot pose in the map frame at this time.
    pose: Pose2,
    /// Covariance of (x, y, theta), row-major, m and rad.
    covariance: [f64; 9],
    /// Capture time of the image of the last fix.
    fixed: Option<Time>,
    /// True if the pose is lost.
    is_lost: bool,
}

/// Pose estimator that fuses odometry and camera images.
#[derive(Clone, Debug)]
pub struct Tracker {
    config: Config,
    /// Speed (m/s) and turn rate (rad/s) above which odometry counts as a jump.
    jump_speed: (f64, f64),
    finder: Finder,
    history: History,
    health: Health,
    odometry: Option<(Time, Pose2)>,
    /// Distance driven in total, m.
    driven_m: f64,
    /// Value of `driven_m` at the last image.
    driven_at_image_m: f64,
    /// Distance driven, plus [`TURN_M`] per radian turned, m.
    moved_m: f64,
    /// Value of `moved_m` at the last fix.
    moved_at_fix_m: f64,
    started: Option<Time>,
    last_image: Option<Time>,
    last_fix_at: Option<Time>,
    last_fix: Option<Fix>,
    unknown_edges_at: Option<Time>,
    /// Large correction that awaits confirmation.
    unconfirmed: Option<Vector3<f64>>,
    /// Agreement of the last images on the pose found by a search around the prior.
    recovered: Agreement,
    search: Option<LookAround>,
}

impl Tracker {
    /// Creates a tracker for this robot with the given pose finder.
    #[must_use]
    pub fn new(config: &Config, finder: Finder, robot: &Robot) -> Self {
        let speed = &robot.limits.speed;
        Self {
            jump_speed: (JUMP_FACTOR * speed[0].max(0.1), JUMP_FACTOR * speed[2].max(0.1)),
            finder,
            history: History::new(CAPACITY, config.odometry.into()),
            health: Health::default(),
            odometry: None,
            driven_m: 0.0,
            driven_at_image_m: 0.0,
            moved_m: 0.0,
            moved_at_fix_m: 0.0,
            started: None,
            last_image: None,
            last_fix_at: None,
            last_fix: None,
            unknown_edges_at: None,
            unconfirmed: None,
            recovered: Agreement::default(),
            search: None,
            config: config.clone(),
        }
    }

    /// Returns the belief at the newest odometry and its time; `None` before any.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, &Belief)> {
        self.history.newest()
    }

    /// Returns the status of the pose estimate and its reason.
    #[must_use]
    pub fn status(&self) -> (PoseStatus, Reason) {
        (self.health.status(), self.health.reason())
    }

    /// Returns the time of the oldest sensor data in the pose: the capture time of the last fix, or the start.
    #[must_use]
    pub fn evidence(&self) -> Time {
        self.last_fix_at.or(self.started).unwrap_or(Time::ZERO)
    }

    /// Returns the capture time of the last image that gave a valid fix; `None` before any.
    #[must_use]
    pub fn last_fix_at(&self) -> Option<Time> {
        self.last_fix_at
    }

    /// Returns the capture time of the last image; `None` before any.
    #[must_use]
    pub fn last_image_at(&self) -> Option<Time> {
        self.last_image
    }

    /// Returns the result of matching the last image, valid or not; `None` before any.
    #[must_use]
    pub fn last_fix(&self) -> Option<&Fix> {
        self.last_fix.as_ref()
    }

    /// Returns the capture time of the last image from which edges that are not on the map were taken; `None` before any.
    #[must_use]
    pub fn unknown_edges_at(&self) -> Option<Time> {
        self.unknown_edges_at
    }

    /// Returns the finder that matches images with the map.
    #[must_use]
    pub fn finder(&self) -> &Finder {
        &self.finder
    }

    /// Returns the search for a lost pose and the current odometry heading (rad); `None` while the pose is known.
    #[must_use]
    pub fn search(&self) -> Option<(&LookAround, f64)> {
        Some((self.search.as_ref()?, self.odometry?.1.theta))
    }

    /// Returns the state to save for a restart; `None` before any odometry.
    #[must_use]
    pub fn state(&self) -> Option<PoseState> {
        let ((stamp, odometry), (_, belief)) = (self.odometry?, self.history.newest()?);
        let covariance = std::array::from_fn(|i| belief.covariance[(i / 3, i % 3)]);
        Some(PoseState {
            stamp,
            odometry,
            pose: belief.pose,
            covariance,
            fixed: self.last_fix_at,
            is_lost: self.search.is_some(),
        })
    }

    /// Restores a saved state. The next odometry supplies the motion since it was saved; the search for a lost pose begins
    /// anew.
    pub fn restore(&mut self, state: &PoseState) {
        let covariance = Matrix3::from_row_slice(&state.covariance);
        let belief = Belief { pose: state.pose, covariance };
        if belief.is_valid() && state.odometry.is_finite() {
            self.history.start(state.stamp, belief);
            self.started = Some(state.stamp);
            self.odometry = Some((state.stamp, state.odometry));
            self.last_fix_at = state.fixed;
            if state.is_lost {
                self.health.lose();
                self.begin_search();
            }
        }
    }

    /// Propagates the pose by an odometry message. A message that is not finite, not newer or from the future is
    /// ignored.
    pub fn take_odometry(&mut self, odometry: &Odometry, now: Time) {
        let (stamp, pose) = (Time(odometry.stamp_ns), Pose2::new(odometry.x, odometry.y, odometry.theta));
        if !pose.is_finite() || stamp.is_future(now) {
            return self.health.doubt(Reason::MalformedInput);
        }
        let Some((last_stamp, last_pose)) = self.odometry else {
            self.history.start(stamp, self.config.start.belief());
            self.started = Some(stamp);
            self.odometry = Some((stamp, pose));
            return;
        };
        if stamp <= last_stamp {
            return;
        }
        self.odometry = Some((stamp, pose));
        let elapsed_s = stamp.seconds_after(last_stamp);
        let increment = Increment::between(&last_pose, &pose);
        let has_jumped = last_pose.distance(&pose) > self.jump_speed.0 * elapsed_s + 0.02
            || increment.turn_rad.abs() > self.jump_speed.1 * elapsed_s + 0.05;
        if has_jumped {
            self.widen(stamp, JUMP_SIGMA.0, JUMP_SIGMA.1);
            self.health.doubt(Reason::MalformedInput);
        } else {
            self.history.advance(stamp, increment);
            self.driven_m += increment.forward_m.abs();
            self.moved_m += increment.forward_m.abs() + TURN_M * increment.turn_rad.abs();
        }
        if let Some((_, belief)) = self.history.newest()
            && self.health.check(belief) == Advice::LookAround
        {
            self.begin_search();
        }
    }

    /// Records a miss if the last image is older than `max_age_s`: the camera delivers no more.
    pub fn check_camera(&mut self, now: Time, max_age_s: f64) {
        if self.last_image.is_some_and(|last| now.seconds_after(last) > max_age_s) {
            self.health.miss(Reason::StaleInput);
        }
    }

    /// Corrects the pose with an image, or searches for a lost pose in it.
    pub fn process_image(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        if self.last_image.is_some_and(|last| stamp <= last) {
            return self.health.miss(Reason::OutOfOrder);
        }
        if stamp.is_future(now) {
            return self.health.miss(Reason::MalformedInput);
        }
        let prior = match self.history.at(stamp) {
            Ok(prior) => prior,
            Err(error) => return self.health.miss(reason(error)),
        };
        self.last_image = Some(stamp);
        if let Err(reason) = self.finder.method_mut().observe(frame) {
            self.health.miss(reason);
            self.count_failed_search(&prior);
        } else if self.search.is_some() {
            self.find(stamp, &prior);
        } else {
            self.fix(stamp, &prior);
        }
    }

    fn fix(&mut self, stamp: Time, prior: &Belief) {
        let noise = self.noise_factors();
        let fix = self.finder.method_mut().fix(prior, noise);
        self.last_fix = Some(fix);
        let driven_m = self.driven_m - self.driven_at_image_m;
        self.driven_at_image_m = self.driven_m;
        match self.health.evaluate(&fix, driven_m) {
            Advice::Continue => {}
            Advice::Inflate => {
                let covariance = prior.covariance * INFLATION;
                self.apply(stamp, prior, Belief { covariance, ..*prior });
                return;
            }
            Advice::LookAround => return self.begin_search(),
        }
        if self.health.has_failed() && self.finder.method().can_recover() {
            if self.recover(stamp, prior, &fix) {
                return;
            }
        } else {
            self.recovered = Agreement::default();
        }
        let is_usable = fix.lines > 0 && fix.verdict != Err(Reason::Ambiguous);
        if !is_usable || self.requires_confirmation(prior, &fix) {
            return;
        }
        let mut posterior = fix.posterior;
        posterior.raise_variances(MIN_VARIANCES);
        if self.apply(stamp, prior, posterior) {
            self.moved_at_fix_m = self.moved_m;
            if fix.verdict.is_ok() {
                self.last_fix_at = Some(stamp);
                self.finder.method_mut().track_unknown();
                self.unknown_edges_at = Some(stamp);
            }
        }
    }

    /// Searches for the pose around a prior at which several images gave no fix, or a weak one. Images in succession must agree
    /// on it; until then the prior grows more uncertain. Returns false if the weak fix is to be applied, because no
    /// other pose matches better.
    fn recover(&mut self, stamp: Time, prior: &Belief, weak: &Fix) -> bool {
        let noise = NoiseFactors { scale: self.health.noise_scale(), correlation: 1.0 };
        let found = self.finder.method_mut().recover(prior, noise);
        let found =
            found.filter(|found| weak.verdict.is_err() || found.lines as f64 > SUPERIOR * weak.lines as f64);
        let correction = found.map(|fix| difference(&fix.posterior.pose, &prior.pose));
        let is_agreed = self.recovered.take(correction);
        if weak.verdict.is_ok() && found.is_none() {
            if (weak.lines as f64) < DOUBTFUL * weak.expected as f64 {
                self.health.doubt(Reason::Ambiguous);
            }
            return false;
        }
        if let Some(fix) = found.filter(|_| is_agreed) {
            if self.apply(stamp, prior, fix.posterior) {
                (self.recovered, self.unconfirmed) = (Agreement::default(), None);
                self.moved_at_fix_m = self.moved_m;
                self.last_fix = Some(fix);
                self.last_fix_at = Some(stamp);
                self.health.recover();
            }
            return true;
        }
        let mut doubtful = *prior;
        let (added_m, added_rad) = DOUBT_SIGMAS;
        let (max_m, max_rad) = MAX_DOUBT_SIGMAS;
        for (i, added, max) in [(0, added_m, max_m), (1, added_m, max_m), (2, added_rad, max_rad)] {
            let variance = &mut doubtful.covariance[(i, i)];
            *variance = (*variance + added * added).min(max * max).max(*variance);
        }
        if weak.verdict.is_ok() {
            self.health.doubt(Reason::Ambiguous);
        }
        self.apply(stamp, prior, doubtful);
        true
    }

    /// Returns true if a correction is large and does not confirm the previous one; stores it until the next image.
    fn requires_confirmation(&mut self, prior: &Belief, fix: &Fix) -> bool {
        let correction = difference(&fix.posterior.pose, &prior.pose);
        let is_large = correction.xy().norm() > LARGE_CORRECTION.0
            || prior.distance_squared(&fix.posterior.pose) > LARGE_CORRECTION.1;
        let is_confirmed = self.unconfirmed.is_some_and(|previous| agree(correction, previous));
        self.unconfirmed = (is_large && !is_confirmed).then_some(correction);
        if self.unconfirmed.is_some() {
            self.health.doubt(Reason::Gated);
        }
        self.unconfirmed.is_some()
    }

    /// Writes a posterior into the history; returns true on success.
    fn apply(&mut self, stamp: Time, prior: &Belief, posterior: Belief) -> bool {
        if !posterior.is_valid() {
            self.health.doubt(Reason::Inconsistent);
            return false;
        }
        let applied = if self.config.retroactive {
            self.history.correct(stamp, posterior)
        } else {
            self.history.correct_newest(stamp, prior, &posterior)
        };
        applied.map_err(|error| self.health.miss(reason(error))).is_ok()
    }

    fn find(&mut self, stamp: Time, prior: &Belief) {
        let noise = NoiseFactors { scale: 1.0, correlation: 1.0 };
        match self.finder.method_mut().search(prior, noise) {
            Some(found) if self.apply(stamp, prior, found) => {
                self.search = None;
                self.unconfirmed = None;
                self.health.recover();
                self.last_fix_at = Some(stamp);
                self.moved_at_fix_m = self.moved_m;
                self.driven_at_image_m = self.driven_m;
                self.finder.method_mut().forget_unknown();
            }
            _ => self.count_failed_search(prior),
        }
    }

    fn begin_search(&mut self) {
        if let Some((_, pose)) = self.odometry {
            self.search = Some(LookAround::begin(pose.theta));
        }
    }

    /// Counts an image, with this prior at its capture, in which the pose was not found.
    fn count_failed_search(&mut self, prior: &Belief) {
        let (Some((_, odometry)), Some((_, newest))) = (self.odometry, self.history.newest()) else { return };
        let turned_since_rad = angle_difference(newest.pose.theta, prior.pose.theta);
        if let Some(search) = &mut self.search {
            search.count_failure(odometry.theta - turned_since_rad);
        }
    }

    fn noise_factors(&self) -> NoiseFactors {
        NoiseFactors { scale: self.health.noise_scale(), correlation: self.correlation() }
    }

    /// Returns the factor on the variance of an image whose errors are correlated with those of the last fix, because
    /// the robot has moved only a little since.
    fn correlation(&self) -> f64 {
        let moved_m = self.moved_m - self.moved_at_fix_m;
        match self.last_fix_at {
            Some(_) => (self.config.correlation_m / moved_m).clamp(1.0, MAX_CORRELATION),
            None => 1.0,
        }
    }

    /// Adds variance to the newest belief (standard deviations in m and rad), which becomes the one at `stamp`, and discards
    /// the older history.
    fn widen(&mut self, stamp: Time, sigma_m: f64, sigma_rad: f64) {
        let Some((_, belief)) = self.history.newest() else { return };
        let mut belief = *belief;
        for (i, sigma) in [sigma_m, sigma_m, sigma_rad].into_iter().enumerate() {
            belief.covariance[(i, i)] += sigma * sigma;
        }
        self.history.start_anew(stamp, belief);
    }
}

fn reason(error: HistoryError) -> Reason {
    match error {
        HistoryError::Empty => Reason::NoInput,
        HistoryError::TooOld => Reason::TooOld,
        HistoryError::OutOfOrder => Reason::OutOfOrder,
        HistoryError::Ahead => Reason::MalformedInput,
    }
}
