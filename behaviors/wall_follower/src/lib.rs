//! Follows a corridor by the vanishing point and the floor lines of its walls.
//!
//! ```
//! use yamabico_core::camera::{Intrinsics, Mount};
//! use yamabico_core::message::{Kind, Reason};
//! use yamabico_core::testing::{Bench, camera_setup};
//! use yamabico_wall_follower::WallFollower;
//!
//! let camera = camera_setup(Intrinsics::from_horizontal_fov(256, 240, 1.0), Mount::level(0.6));
//! let mut bench = Bench::<WallFollower>::new("speed_mps = 0.4", camera)?;
//! let proposal = bench.at(0.1).propose(); // no frame yet
//! assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::NoInput)));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```
//!
//! Kweon et al. (1991): the vanishing point gives the heading, the floor lines give the lateral position. Differs from the
//! paper: exact for any heading, tilt and roll, and steers while driving instead of stopping to look.

pub mod centering;
pub mod config;
pub mod corridor_track;
pub mod recovery;

pub use config::Config;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{Axes, FrameHeader, Odometry, Proposal, Reason, View};
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;

use crate::centering::{Centering, align_in_place, allowed_speed};
use crate::corridor_track::{CorridorTrack, Estimate, Motion, Verdict};
use crate::recovery::{Loss, Recoverer, Recovery};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver};
use yamabico_vision::vanishing_point::VanishingPointError;

/// Input: frames of the camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the corridor ahead");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::optional("odometry", "motion between frames");

/// Heading error (rad) above which the robot turns back in place before it drives.
const TURN_FIRST_RAD: f64 = 1.05;
/// Heading (rad) away from a wall that is too near.
const STEER_AWAY_RAD: f64 = 0.262;
/// Speed while steering away from a near wall, m/s.
const CREEP_MPS: f64 = 0.1;
/// Maximum turn rate of the search, rad/s.
const SEARCH_RADPS: f64 = 0.5;
/// Age above which odometry is stale, s.
const ODOMETRY_STALE_S: f64 = 0.3;

/// The behavior: drives along the centerline of a corridor.
#[derive(Clone, Debug)]
pub struct WallFollower {
    config: Config,
    law: Centering,
    radius_m: f64,
    observer: CorridorObserver,
    odometry: OdometryTrack,
    track: CorridorTrack,
    recoverer: Recoverer,
    gray: GrayImage,
    last_frame: Option<Time>,
    last_found: Option<Found>,
    failure: Option<Reason>,
}

/// The last frame with a vanishing point.
#[derive(Clone, Copy, Debug)]
struct Found {
    stamp: Time,
    pose: Option<Pose2>,
}

/// Result of one call for the camera input.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FrameResult {
    /// No new frame.
    Nothing,
    /// A new frame that gave a heading.
    Found,
    /// A new frame without a usable heading.
    NotFound,
}

impl Plugin for WallFollower {
    type Config = Config;
    const NAME: &'static str = "wall-follower";
    const SUMMARY: &'static str =
        "Follows a corridor by the vanishing point and the floor lines of its walls.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        config.check()?;
        let MountedPinhole { pinhole, mount, calibration, .. } = setup.pinhole(&CAMERA)?;
        let camera = CorridorCamera {
            pinhole,
            mount,
            calibration,
            horizon_sigma_rad: config.horizon_sigma_deg.to_radians(),
        };
        let rule = FloorLineRule { min_contrast: config.floor_contrast, ..FloorLineRule::default() };
        Ok(Self {
            law: Centering {
                length_m: config.convergence_m,
                damping: config.damping,
                largest_offset_m: config.largest_offset_m,
                largest_turn_radps: config.largest_turn_radps,
            },
            radius_m: setup.robot.radius_m,
            observer: CorridorObserver::new(camera, rule),
            config,
            odometry: OdometryTrack::default(),
            track: CorridorTrack::default(),
            recoverer: Recoverer::default(),
            gray: GrayImage::default(),
            last_frame: None,
            last_found: None,
            failure: None,
        })
    }
}

impl Behavior for WallFollower {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        let had_odometry = self.odometry.newest().is_some();
        for odometry in inputs.fresh(&ODOMETRY) {
            self.odometry.push(odometry.header, now);
        }
        if !had_odometry && self.odometry.newest().is_some() {
            // Earlier estimates do not refer to the odometry frame.
            self.track.lose();
        }
        let result = match inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            Some(frame) => self.process_frame(&frame, now),
            None => FrameResult::Nothing,
        };
        let Some(last_frame) = self.last_frame else {
            return Proposal::abstain(self.failure.unwrap_or(Reason::NoInput));
        };
        let pose = match self.pose_at(now) {
            Ok(pose) => pose,
            Err(reason) => return Proposal::abstain(reason).with_evidence(last_frame),
        };
        let evidence = self.last_found.map_or(last_frame, |found| found.stamp);
        let estimate = self.track.estimate_at(&pose.unwrap_or_default());
        let proposal = match (self.recovery(result, pose, now), estimate) {
            (None, Some(estimate)) => self.follow(&estimate, 1.0).with_evidence(evidence),
            (Some(Recovery::Coast), Some(estimate)) => {
                self.follow(&estimate, 0.5).with_evidence(evidence).with_reason(Reason::Coasting)
            }
            (Some(Recovery::TurnTo(heading)), _) => {
                turn_in_place(pose.map_or(0.0, |pose| pose.theta), heading, SEARCH_RADPS)
                    .with_evidence(last_frame)
                    .with_reason(Reason::Searching)
            }
            _ => Proposal::abstain(self.loss_reason(last_frame, now)).with_evidence(evidence),
        };
        self.stamped(proposal)
    }
}

impl WallFollower {
    /// Returns the robot's state in the corridor at the newest odometry; `None` without a heading.
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate> {
        self.track.estimate_at(&self.odometry.newest().map_or(Pose2::IDENTITY, |reading| reading.pose))
    }

    fn process_frame(&mut self, frame: &View<'_, FrameHeader>, now: Time) -> FrameResult {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.last_frame.is_none_or(|last| stamp > last);
        if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.failure = Some(Reason::MalformedInput);
            return FrameResult::Nothing;
        }
        let pose = self.odometry.pose_at(stamp);
        let elapsed_s = self.last_frame.map_or(0.0, |last| stamp.seconds_after(last));
        self.track.predict(pose.map_or(Motion::Unknown { elapsed_s }, Motion::To));
        self.last_frame = Some(stamp);
        let seen = match frame.gray(self.observer.camera().pinhole.intrinsics().size(), &mut self.gray) {
            Some(image) => self.observer.observe(image, self.track.prediction()).map_err(heading_failure),
            None => Err(Reason::MalformedInput),
        };
        let verdict = seen.map(|observation| self.track.update(&observation));
        self.failure = match verdict {
            Ok(Verdict::Accepted) => None,
            Ok(Verdict::Gated) => Some(Reason::Gated),
            Err(reason) => Some(reason),
        };
        if self.failure.is_some() {
            return FrameResult::NotFound;
        }
        self.last_found = Some(Found { stamp, pose });
        FrameResult::Found
    }

    /// Returns the odometry pose at `now`; `Ok(None)` if the robot has no odometry, an error if it is stale.
    fn pose_at(&self, now: Time) -> Result<Option<Pose2>, Reason> {
        match self.odometry.newest() {
            None => Ok(None),
            Some(newest) if now.seconds_after(newest.stamp) > ODOMETRY_STALE_S => Err(Reason::StaleInput),
            Some(_) => Ok(self.odometry.pose_at(now)),
        }
    }

    /// Returns the recovery action while no vanishing point is found; `None` otherwise.
    fn recovery(&mut self, result: FrameResult, pose: Option<Pose2>, now: Time) -> Option<Recovery> {
        if result == FrameResult::Found {
            self.recoverer.found();
        }
        let age_s = self.last_found.map_or(f64::INFINITY, |found| now.seconds_after(found.stamp));
        if self.failure.is_none() && age_s <= self.config.lost.coast_s {
            return None;
        }
        let driven_m = match (self.last_found.and_then(|found| found.pose), pose) {
            (Some(then), Some(pose)) => then.distance(&pose),
            _ => 0.0,
        };
        let loss = Loss {
            for_s: age_s,
            for_m: driven_m,
            // Turning does not help against a silent camera or malformed frames.
            heading: pose
                .map(|pose| pose.theta)
                .filter(|_| self.failure.is_some_and(|why| why != Reason::MalformedInput)),
            has_new_frame: result == FrameResult::NotFound,
        };
        let recovery = self.recoverer.step(&loss, &self.config.lost);
        if recovery != Recovery::Coast {
            self.track.lose();
        }
        Some(recovery)
    }

    /// Returns the reason for which there is no heading.
    fn loss_reason(&self, last_frame: Time, now: Time) -> Reason {
        let is_silent = now.seconds_after(last_frame) > self.config.lost.coast_s;
        self.failure.unwrap_or(if is_silent { Reason::StaleInput } else { Reason::HeadingLost })
    }

    /// Proposes to follow the corridor at `share` of the cruising speed.
    fn follow(&self, estimate: &Estimate, share: f64) -> Proposal {
        let walls = &estimate.walls;
        let clearance_m = walls.nearest_m() - self.radius_m;
        if estimate.heading.abs() > TURN_FIRST_RAD {
            return turn_in_place(estimate.heading, 0.0, self.config.largest_turn_radps)
                .with_reason(Reason::EdgeOn);
        }
        if clearance_m < self.config.near_wall_m {
            return self.steer_away(estimate, clearance_m, share);
        }
        let lateral_m = walls.lateral_left_of_target(estimate.width_m, self.config.single_wall_m);
        let speed = share * allowed_speed(self.config.speed_mps, estimate.heading, clearance_m);
        let turn = self.law.turn_rate(speed, estimate.heading, lateral_m);
        let reason = match (walls.left_m, walls.right_m) {
            (Some(_), Some(_)) => Reason::Nominal,
            (Some(_), None) => Reason::OneWallLeft,
            (None, Some(_)) => Reason::OneWallRight,
            (None, None) => match self.observer.camera().calibration {
                Calibration::Measured => Reason::NoWall,
                Calibration::Guessed => Reason::NoHeightCalibration,
            },
        };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
            .with_reason(reason)
            .with_confidence(1.0 / (1.0 + (estimate.heading_sigma / 0.02).powi(2)))
            .with_note(format_args!(
                "heading {:+.1} deg, {:+.2} m left of the line",
                estimate.heading.to_degrees(),
                lateral_m
            ))
    }

    /// Proposes to steer away from a near wall, and to turn in place first if it is very near.
    fn steer_away(&self, estimate: &Estimate, clearance_m: f64, share: f64) -> Proposal {
        let left_m = estimate.walls.left_m.map_or(f64::INFINITY, f64::abs);
        let is_left = left_m <= estimate.walls.nearest_m();
        let target = if is_left { -STEER_AWAY_RAD } else { STEER_AWAY_RAD };
        let leads_away = estimate.heading * target.signum() > 0.5 * STEER_AWAY_RAD;
        let turn = align_in_place(estimate.heading, target, self.config.largest_turn_radps);
        let speed = if clearance_m < self.config.stop_wall_m && !leads_away {
            0.0
        } else {
            share * self.config.speed_mps.min(CREEP_MPS)
        };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
            .uncoupled()
            .with_reason(Reason::WallNear)
            .with_note(format_args!("wall at {clearance_m:.2} m"))
    }

    /// Stamps the proposal with the time to which the state was propagated.
    fn stamped(&self, mut proposal: Proposal) -> Proposal {
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }
}

/// Proposes a turn in place toward `target`. Uncoupled: it continues under a halt of translation only.
fn turn_in_place(heading: f64, target: f64, largest_radps: f64) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::planar(0.0, align_in_place(heading, target, largest_radps)))
        .uncoupled()
}

/// Converts the reason for a missing vanishing point to the reason of a proposal.
fn heading_failure(error: VanishingPointError) -> Reason {
    match error {
        VanishingPointError::TooFewSegments { .. } => Reason::TooFewSegments,
        VanishingPointError::NoVanishingPoint => Reason::NoVanishingPoint,
        VanishingPointError::Degenerate => Reason::Degenerate,
        VanishingPointError::Ambiguous => Reason::Ambiguous,
    }
}
