//! Keeps the pose: dead reckoning, fixes at the instants of their pictures, and the search when it is lost.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FrameHeader, Odometry, PoseStatus, Reason, View};
use yamabico_core::odometry_track::FUTURE_TOLERANCE_S;
use yamabico_core::sensor::Robot;
use yamabico_core::time::Time;

use crate::belief::{Belief, difference};
use crate::config::Config;
use crate::finder::Finder;
use crate::fix::{Fix, Trust};
use crate::health::{Advice, Health, INFLATION};
use crate::history::{CAPACITY, History, HistoryError};
use crate::look_around::LookAround;
use crate::motion::Increment;

/// The least variances of a belief after a fix: 5 mm, 5 mm, 0.1 degrees.
const FLOOR: [f64; 3] = [25e-6, 25e-6, 3.046e-6];
/// A correction by more than this (m), or beyond this squared distance, waits for the next picture to agree ...
const LARGE: (f64, f64) = (0.5, 14.16);
/// ... within these (m, rad).
const AGREEING: (f64, f64) = (0.15, 0.05);
/// Turning by a radian changes what is seen as much as driving so far, meters.
const TURN_M: f64 = 0.5;
/// Pictures from one place still tell a little.
const MAX_REPETITION: f64 = 50.0;
/// Odometry that moves faster than the robot can by this factor has jumped ...
const JUMP_FACTOR: f64 = 3.0;
/// ... and says nothing of the motion but this (m, rad).
const JUMP_SIGMA: (f64, f64) = (0.1, 0.1);

/// What is known of the robot's place at an instant, to go on from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// The instant.
    stamp: Time,
    /// What the odometry told.
    odometry: Pose2,
    /// Map from robot.
    pose: Pose2,
    /// Of (x, y, theta), row by row.
    covariance: [f64; 9],
    /// When the picture of the last fix was taken.
    fixed: Option<Time>,
}

/// Where the robot is, by its camera and its wheels.
#[derive(Clone, Debug)]
pub struct Tracker {
    config: Config,
    /// Faster than this (m/s, rad/s) only odometry that jumps is.
    fastest: (f64, f64),
    finder: Finder,
    history: History,
    health: Health,
    odometry: Option<(Time, Pose2)>,
    driven_m: f64,
    looked_at_m: f64,
    /// Driven, and turned for [`TURN_M`] a radian.
    moved_m: f64,
    fixed_at_m: f64,
    begun: Option<Time>,
    last_picture: Option<Time>,
    last_fix: Option<Time>,
    seen: Option<Fix>,
    held: Option<Vector3<f64>>,
    search: Option<LookAround>,
}

impl Tracker {
    /// One for this robot, with a way to find it.
    #[must_use]
    pub fn new(config: &Config, finder: Finder, robot: &Robot) -> Self {
        let speed = &robot.limits.speed;
        Self {
            fastest: (JUMP_FACTOR * speed[0].max(0.1), JUMP_FACTOR * speed[2].max(0.1)),
            finder,
            history: History::new(CAPACITY, config.odometry.into()),
            health: Health::default(),
            odometry: None,
            driven_m: 0.0,
            looked_at_m: 0.0,
            moved_m: 0.0,
            fixed_at_m: 0.0,
            begun: None,
            last_picture: None,
            last_fix: None,
            seen: None,
            held: None,
            search: None,
            config: config.clone(),
        }
    }

    /// The belief at the newest odometry, and when that was; `None` before any.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, &Belief)> {
        self.history.newest()
    }

    /// How far the pose can be trusted, and why.
    #[must_use]
    pub fn status(&self) -> (PoseStatus, Reason) {
        (self.health.status(), self.health.reason())
    }

    /// Oldest sensor data in the pose: the last picture that gave a fix, or the beginning.
    #[must_use]
    pub fn evidence(&self) -> Time {
        self.last_fix.or(self.begun).unwrap_or(Time::ZERO)
    }

    /// When the picture of the last fix was taken; `None` before any.
    #[must_use]
    pub fn last_fix_at(&self) -> Option<Time> {
        self.last_fix
    }

    /// When the last picture was taken; `None` before any.
    #[must_use]
    pub fn last_picture_at(&self) -> Option<Time> {
        self.last_picture
    }

    /// What the last picture told; `None` before any.
    #[must_use]
    pub fn last_fix(&self) -> Option<&Fix> {
        self.seen.as_ref()
    }

    /// What looks at the pictures.
    #[must_use]
    pub fn finder(&self) -> &Finder {
        &self.finder
    }

    /// The search for a lost pose, and the odometry's heading (rad) that it refers to; `None` while the pose is known.
    #[must_use]
    pub fn search(&self) -> Option<(&LookAround, f64)> {
        Some((self.search.as_ref()?, self.odometry?.1.theta))
    }

    /// What a successor must know; `None` before any odometry.
    #[must_use]
    pub fn memory(&self) -> Option<Track> {
        let ((stamp, odometry), (_, belief)) = (self.odometry?, self.history.newest()?);
        let covariance = std::array::from_fn(|i| belief.covariance[(i / 3, i % 3)]);
        Some(Track { stamp, odometry, pose: belief.pose, covariance, fixed: self.last_fix })
    }

    /// Goes on where a predecessor stopped; the next odometry tells how far the robot has come since.
    pub fn recall(&mut self, track: &Track) {
        let covariance = Matrix3::from_row_slice(&track.covariance);
        let belief = Belief { pose: track.pose, covariance };
        if belief.is_sound() && track.odometry.is_finite() {
            self.history.start(track.stamp, belief);
            self.begun = Some(track.stamp);
            self.odometry = Some((track.stamp, track.odometry));
            self.last_fix = track.fixed;
        }
    }

    /// Takes a reading of the odometry; what is not finite, not newer, or from the future moves nothing.
    pub fn take_odometry(&mut self, odometry: &Odometry, now: Time) {
        let (stamp, pose) = (Time(odometry.stamp_ns), Pose2::new(odometry.x, odometry.y, odometry.theta));
        if !pose.is_finite() || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            return self.health.doubt(Reason::MalformedInput);
        }
        let Some((last_stamp, last_pose)) = self.odometry else {
            self.history.start(stamp, self.config.start.belief());
            self.begun = Some(stamp);
            self.odometry = Some((stamp, pose));
            return;
        };
        if stamp <= last_stamp {
            return;
        }
        self.odometry = Some((stamp, pose));
        let elapsed_s = stamp.seconds_after(last_stamp);
        let increment = Increment::between(&last_pose, &pose);
        let has_jumped = last_pose.distance(&pose) > self.fastest.0 * elapsed_s + 0.02
            || increment.turn_rad.abs() > self.fastest.1 * elapsed_s + 0.05;
        if has_jumped {
            self.history.advance(stamp, Increment::default());
            self.widen(JUMP_SIGMA.0, JUMP_SIGMA.1);
            self.health.doubt(Reason::MalformedInput);
        } else {
            self.history.advance(stamp, increment);
            self.driven_m += increment.forward_m.abs();
            self.moved_m += increment.forward_m.abs() + TURN_M * increment.turn_rad.abs();
        }
        if let Some((_, belief)) = self.history.newest()
            && self.health.watch(belief) == Advice::LookAround
        {
            self.begin_search();
        }
    }

    /// Takes a picture: a fix, or a try to find the pose again.
    pub fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        if self.last_picture.is_some_and(|last| stamp <= last) {
            return self.health.miss(Reason::OutOfOrder);
        }
        if stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            return self.health.miss(Reason::MalformedInput);
        }
        let prior = match self.history.at(stamp) {
            Ok(prior) => prior,
            Err(error) => return self.health.miss(reason(error)),
        };
        self.last_picture = Some(stamp);
        if let Err(reason) = self.finder.method_mut().take(frame) {
            self.health.miss(reason);
            self.search_in_vain();
        } else if self.search.is_some() {
            self.find(stamp, &prior);
        } else {
            self.fix(stamp, &prior);
        }
    }

    fn fix(&mut self, stamp: Time, prior: &Belief) {
        let trust = self.trust();
        let fix = self.finder.method_mut().fix(prior, trust);
        self.seen = Some(fix);
        let driven_m = self.driven_m - self.looked_at_m;
        self.looked_at_m = self.driven_m;
        match self.health.take(&fix, driven_m) {
            Advice::GoOn => {}
            Advice::Inflate => {
                let covariance = prior.covariance * INFLATION;
                self.apply(stamp, prior, Belief { covariance, ..*prior });
                return;
            }
            Advice::LookAround => return self.begin_search(),
        }
        let is_usable = fix.lines > 0 && fix.verdict != Err(Reason::Ambiguous);
        if !is_usable || self.is_held_back(prior, &fix) {
            return;
        }
        let mut posterior = fix.posterior;
        posterior.floor(FLOOR);
        if self.apply(stamp, prior, posterior) {
            self.fixed_at_m = self.moved_m;
            if fix.verdict.is_ok() {
                self.last_fix = Some(stamp);
                self.finder.method_mut().follow_unknown();
            }
        }
    }

    /// Whether a correction is so large that the next picture must confirm it first.
    fn is_held_back(&mut self, prior: &Belief, fix: &Fix) -> bool {
        let correction = difference(&fix.posterior.pose, &prior.pose);
        let is_large =
            correction.xy().norm() > LARGE.0 || prior.distance_squared(&fix.posterior.pose) > LARGE.1;
        let is_confirmed = self.held.is_some_and(|held| {
            let off = correction - held;
            off.xy().norm() < AGREEING.0 && off.z.abs() < AGREEING.1
        });
        self.held = (is_large && !is_confirmed).then_some(correction);
        if self.held.is_some() {
            self.health.doubt(Reason::Gated);
        }
        self.held.is_some()
    }

    /// Writes a result into the history; whether that was possible.
    fn apply(&mut self, stamp: Time, prior: &Belief, posterior: Belief) -> bool {
        if !posterior.is_sound() {
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
        let trust = Trust { scale: 1.0, repetition: 1.0 };
        match self.finder.method_mut().search(prior, trust) {
            Some(found) if self.apply(stamp, prior, found) => {
                self.search = None;
                self.held = None;
                self.health.found();
                self.last_fix = Some(stamp);
            }
            _ => self.search_in_vain(),
        }
    }

    fn begin_search(&mut self) {
        if let Some((_, pose)) = self.odometry {
            self.search = Some(LookAround::begin(pose.theta));
        }
    }

    fn search_in_vain(&mut self) {
        if let (Some(search), Some((_, pose))) = (&mut self.search, self.odometry) {
            search.picture(pose.theta);
        }
    }

    fn trust(&self) -> Trust {
        Trust { scale: self.health.noise_scale(), repetition: self.repetition() }
    }

    /// By how much a picture tells less than its lines could, because those of the picture before stood in nearly the same
    /// places and err alike.
    fn repetition(&self) -> f64 {
        let moved_m = self.moved_m - self.fixed_at_m;
        match self.last_fix {
            Some(_) => (self.config.correlation_m / moved_m).clamp(1.0, MAX_REPETITION),
            None => 1.0,
        }
    }

    /// Adds doubt to the newest belief, m and rad; what was before is forgotten.
    fn widen(&mut self, sigma_m: f64, sigma_rad: f64) {
        let Some((stamp, belief)) = self.history.newest() else { return };
        let mut belief = *belief;
        for (i, sigma) in [sigma_m, sigma_m, sigma_rad].into_iter().enumerate() {
            belief.covariance[(i, i)] += sigma * sigma;
        }
        self.history.start(stamp, belief);
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
