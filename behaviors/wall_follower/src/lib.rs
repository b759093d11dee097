//! Follows a corridor by the vanishing point and the floor lines of its walls.
//!
//! Kweon et al. (1991): the vanishing point gives the heading, the floor lines the place between the walls.
//! Differs from \[1\]: exact for any heading, tilt and roll, and steers while driving instead of stopping to look.

pub mod centering;
pub mod config;
pub mod corridor_track;
pub mod recovery;
pub mod stereo;
pub mod stereo_match;

pub use config::Config;

use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
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
use yamabico_vision::corridor::sight::{CorridorCamera, Sight};
use yamabico_vision::vanishing_point::VanishingPointError;

/// The camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "pictures of the corridor ahead");
/// Where the wheels say the robot is.
pub const ODOMETRY: Slot<Odometry> = Slot::optional("odometry", "motion between pictures");

/// Turned away from the corridor's axis by more (rad), the robot first turns back where it stands.
const TURN_FIRST_RAD: f64 = 1.05;
/// Heading (rad) away from a wall that is too near.
const STEER_AWAY_RAD: f64 = 0.262;
/// Speed of creeping away from a wall, m/s.
const CREEP_MPS: f64 = 0.1;
/// Largest turn rate of the search, rad/s.
const SEARCH_RADPS: f64 = 0.5;
/// Odometry older than this (s) is none.
const ODOMETRY_STALE_S: f64 = 0.3;

/// Drives along the middle of a corridor.
#[derive(Clone, Debug)]
pub struct WallFollower {
    config: Config,
    law: Centering,
    radius_m: f64,
    sight: Sight,
    odometry: OdometryTrack,
    track: CorridorTrack,
    recoverer: Recoverer,
    gray: GrayImage,
    last_picture: Option<Time>,
    last_found: Option<Found>,
    trouble: Option<Reason>,
}

/// The last picture with a vanishing point.
#[derive(Clone, Copy, Debug)]
struct Found {
    stamp: Time,
    pose: Option<Pose2>,
}

/// What a call learnt from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Look {
    /// No new picture.
    Nothing,
    /// A new picture that gave a heading.
    Found,
    /// A new picture that did not.
    NotFound,
}

impl Plugin for WallFollower {
    type Config = Config;
    const NAME: &'static str = "wall-follower";
    const SUMMARY: &'static str =
        "Follows a corridor by the vanishing point and the floor lines of its walls.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
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
            sight: Sight::new(camera, rule),
            config,
            odometry: OdometryTrack::default(),
            track: CorridorTrack::default(),
            recoverer: Recoverer::default(),
            gray: GrayImage::default(),
            last_picture: None,
            last_found: None,
            trouble: None,
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
            // What was seen so far does not refer to the odometry frame.
            self.track.lose();
        }
        let look = match inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            Some(frame) => self.look(&frame, now),
            None => Look::Nothing,
        };
        let Some(last_picture) = self.last_picture else {
            return Proposal::abstain(self.trouble.unwrap_or(Reason::NoInput));
        };
        let pose = match self.pose_at(now) {
            Ok(pose) => pose,
            Err(reason) => return Proposal::abstain(reason).with_evidence(last_picture),
        };
        let evidence = self.last_found.map_or(last_picture, |found| found.stamp);
        let estimate = self.track.estimate_at(&pose.unwrap_or_default());
        let proposal = match (self.recovery(look, pose, now), estimate) {
            (None, Some(estimate)) => self.follow(&estimate, 1.0).with_evidence(evidence),
            (Some(Recovery::Coast), Some(estimate)) => {
                self.follow(&estimate, 0.5).with_evidence(evidence).because(Reason::Coasting)
            }
            (Some(Recovery::TurnTo(heading)), _) => {
                turn_in_place(pose.map_or(0.0, |pose| pose.theta), heading, SEARCH_RADPS)
                    .with_evidence(last_picture)
                    .because(Reason::Searching)
            }
            _ => Proposal::abstain(self.why_lost(last_picture, now)).with_evidence(evidence),
        };
        self.stamped(proposal)
    }
}

impl WallFollower {
    /// The robot in the corridor by the newest picture, at its odometry's newest reading; `None` without a heading.
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate> {
        self.track.estimate_at(&self.odometry.newest().map_or(Pose2::IDENTITY, |reading| reading.pose))
    }

    fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) -> Look {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.last_picture.is_none_or(|last| stamp > last);
        if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.trouble = Some(Reason::MalformedInput);
            return Look::Nothing;
        }
        let pose = self.odometry.pose_at(stamp);
        let elapsed_s = self.last_picture.map_or(0.0, |last| stamp.seconds_after(last));
        self.track.predict(pose.map_or(Motion::Unknown { elapsed_s }, Motion::To));
        self.last_picture = Some(stamp);
        let seen = match frame.gray(self.sight.camera().pinhole.intrinsics().size(), &mut self.gray) {
            Some(image) => self.sight.look(image, self.track.expectation()).map_err(no_heading),
            None => Err(Reason::MalformedInput),
        };
        let verdict = seen.map(|sighting| self.track.update(&sighting));
        self.trouble = match verdict {
            Ok(Verdict::Accepted) => None,
            Ok(Verdict::Gated) => Some(Reason::Gated),
            Err(reason) => Some(reason),
        };
        if self.trouble.is_some() {
            return Look::NotFound;
        }
        self.last_found = Some(Found { stamp, pose });
        Look::Found
    }

    /// The pose at `now`; `Ok(None)` for a robot without odometry, an error where it fell silent.
    fn pose_at(&self, now: Time) -> Result<Option<Pose2>, Reason> {
        match self.odometry.newest() {
            None => Ok(None),
            Some(newest) if now.seconds_after(newest.stamp) > ODOMETRY_STALE_S => Err(Reason::StaleInput),
            Some(_) => Ok(self.odometry.pose_at(now)),
        }
    }

    /// What to do about a vanishing point that is not found; `None` while it is.
    fn recovery(&mut self, look: Look, pose: Option<Pose2>, now: Time) -> Option<Recovery> {
        if look == Look::Found {
            self.recoverer.found();
        }
        let age_s = self.last_found.map_or(f64::INFINITY, |found| now.seconds_after(found.stamp));
        if self.trouble.is_none() && age_s <= self.config.lost.coast_s {
            return None;
        }
        let driven_m = match (self.last_found.and_then(|found| found.pose), pose) {
            (Some(then), Some(pose)) => then.distance(&pose),
            _ => 0.0,
        };
        let loss = Loss {
            for_s: age_s,
            for_m: driven_m,
            // A camera that is silent or sends no pictures shows nothing more on the other side.
            heading: pose
                .map(|pose| pose.theta)
                .filter(|_| self.trouble.is_some_and(|why| why != Reason::MalformedInput)),
            has_new_picture: look == Look::NotFound,
        };
        let recovery = self.recoverer.step(&loss, &self.config.lost);
        if recovery != Recovery::Coast {
            self.track.lose();
        }
        Some(recovery)
    }

    /// Why there is nothing to steer by.
    fn why_lost(&self, last_picture: Time, now: Time) -> Reason {
        let is_silent = now.seconds_after(last_picture) > self.config.lost.coast_s;
        self.trouble.unwrap_or(if is_silent { Reason::StaleInput } else { Reason::HeadingLost })
    }

    /// Along the corridor, with `share` of the cruising speed.
    fn follow(&self, estimate: &Estimate, share: f64) -> Proposal {
        let walls = &estimate.walls;
        let clearance_m = walls.nearest_m() - self.radius_m;
        if estimate.heading.abs() > TURN_FIRST_RAD {
            return turn_in_place(estimate.heading, 0.0, self.config.largest_turn_radps)
                .because(Reason::EdgeOn);
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
            (None, None) => match self.sight.camera().calibration {
                Calibration::Measured => Reason::NoWall,
                Calibration::Guessed => Reason::NoHeightCalibration,
            },
        };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
            .because(reason)
            .with_confidence(1.0 / (1.0 + (estimate.heading_sigma / 0.02).powi(2)))
            .with_note(format_args!(
                "heading {:+.1} deg, {:+.2} m left of the line",
                estimate.heading.to_degrees(),
                lateral_m
            ))
    }

    /// Away from a wall that is too near: turned in place first where it is very near.
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
            .because(Reason::WallNear)
            .with_note(format_args!("wall at {clearance_m:.2} m"))
    }

    /// With the instant that the state was propagated to.
    fn stamped(&self, mut proposal: Proposal) -> Proposal {
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }
}

/// A turn where the robot stands, from one heading to another; keeps turning where a halt names only translation.
fn turn_in_place(heading: f64, target: f64, largest_radps: f64) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::planar(0.0, align_in_place(heading, target, largest_radps)))
        .uncoupled()
}

/// Why a picture has no heading, as proposals say it.
fn no_heading(error: VanishingPointError) -> Reason {
    match error {
        VanishingPointError::TooFewSegments { .. } => Reason::TooFewSegments,
        VanishingPointError::NoVanishingPoint => Reason::NoVanishingPoint,
        VanishingPointError::Degenerate => Reason::Degenerate,
        VanishingPointError::Ambiguous => Reason::Ambiguous,
    }
}
