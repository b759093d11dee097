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

pub mod ahead;
pub mod centering;
pub mod config;
pub mod corridor_track;
pub mod direction;
mod floor_reach;
pub mod overlay;
pub mod recovery;
pub mod sight;
mod steering;
mod wall_track;
mod width_memory;

pub use config::Config;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{Axes, Corridor, FrameHeader, Imu, Kind, Odometry, Proposal, Reason, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::CorridorCamera;
use yamabico_vision::corridor_evidence::Action;

use crate::ahead::AheadTrack;
use crate::centering::Centering;
use crate::corridor_track::{CorridorTrack, Estimate, Motion, Verdict};
use crate::direction::Direction;
use crate::floor_reach::FloorReach;
use crate::recovery::{Loss, Recoverer, Recovery};
use crate::sight::{Seen, Sight};
use crate::steering::{presumed_confidence, turn_in_place};

/// Input: frames of the camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the corridor ahead");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::optional("odometry", "motion between frames");
/// Input: the gyro.
pub const IMU: Slot<Imu> = Slot::optional("imu", "turn rate, in place of that of the wheels");
/// Output: the corridor that is followed.
pub const CORRIDOR: Slot<Corridor> =
    Slot::required("corridor", "the corridor ahead: heading, walls, probability");

/// Maximum turn rate of the search, rad/s.
const SEARCH_RADPS: f64 = 0.5;
/// Number of frames with a vanishing point that establish a corridor.
const ESTABLISHED_FRAMES: u32 = 5;
/// Age above which odometry is stale, s.
const ODOMETRY_STALE_S: f64 = 0.3;
/// Time without a frame after which the robot slows down, and minimum time after which the camera is silent, s.
const MIN_SILENT_S: f64 = 0.5;

/// The behavior: drives along the centerline of a corridor.
#[derive(Clone, Debug)]
pub struct WallFollower {
    config: Config,
    law: Centering,
    radius_m: f64,
    sight: Sight,
    floor: Option<FloorReach>,
    odometry: OdometryTrack,
    track: CorridorTrack,
    ahead: AheadTrack,
    recoverer: Recoverer,
    direction: Direction,
    gray: GrayImage,
    sequence: u64,
    last_frame: Option<Time>,
    last_pose: Option<Pose2>,
    last_found: Option<Found>,
    failure: Option<Reason>,
    /// Probability of a corridor at the last frame, and what it allows; `None` from the method that does not judge.
    evidence: Option<(f64, Action)>,
    /// Number of frames with a vanishing point since the last loss; zero before the first.
    found_in_row: u32,
    /// Heading (rad, odometry frame) of a turn at the end of the corridor.
    turning_to: Option<f64>,
    is_mount_wrong: bool,
    /// Result of the last frame; `None` before the first.
    seen: Option<Seen>,
}

/// The last frame with a vanishing point.
#[derive(Clone, Copy, Debug)]
struct Found {
    stamp: Time,
    pose: Option<Pose2>,
    /// Share of the cruising speed that it allowed.
    share: f64,
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
    /// A new frame that shows too little of a corridor that is still probable.
    Held,
}

impl Plugin for WallFollower {
    type Config = Config;
    const NAME: &'static str = "wall-follower";
    const SUMMARY: &'static str =
        "Follows a corridor by the vanishing point and the floor lines of its walls.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), IMU.info()];
    const OUTPUTS: &'static [SlotInfo] = &[CORRIDOR.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        config.check()?;
        let MountedPinhole { pinhole, mount, calibration, .. } = setup.pinhole(&CAMERA)?;
        let stated_sigma_rad = config.horizon_sigma_deg.map(f64::to_radians);
        let horizon_sigma_rad = Sight::horizon_sigma(stated_sigma_rad, calibration);
        let camera = CorridorCamera { pinhole, mount, calibration, horizon_sigma_rad };
        let rule = FloorLineRule {
            min_contrast: config.floor_contrast,
            min_width_m: config.min_width_m,
            ..FloorLineRule::default()
        };
        let track = CorridorTrack::new(config.min_width_m);
        Ok(Self {
            law: Centering {
                length_m: config.convergence_m,
                damping: config.damping,
                largest_offset_m: config.max_offset_m,
                largest_turn_radps: config.max_turn_radps,
            },
            radius_m: setup.robot.radius_m,
            floor: (config.uses_motion && calibration == Calibration::Measured)
                .then(|| FloorReach::new(&pinhole, mount))
                .flatten(),
            sight: Sight::new(config.method, camera, stated_sigma_rad, rule),
            config,
            odometry: OdometryTrack::default(),
            track,
            ahead: AheadTrack::default(),
            recoverer: Recoverer::default(),
            direction: Direction::default(),
            gray: GrayImage::default(),
            sequence: 0,
            last_frame: None,
            last_pose: None,
            last_found: None,
            failure: None,
            evidence: None,
            found_in_row: 0,
            turning_to: None,
            is_mount_wrong: false,
            seen: None,
        })
    }

    fn notes(config: &Config, _: &Setup) -> Vec<String> {
        config.notes()
    }
}

impl Behavior for WallFollower {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        let had_odometry = self.odometry.newest().is_some();
        for imu in inputs.fresh(&IMU) {
            self.odometry.push_imu(imu.header, now);
        }
        for odometry in inputs.fresh(&ODOMETRY) {
            self.odometry.push(odometry.header, now);
        }
        if !had_odometry && self.odometry.newest().is_some() {
            // Earlier estimates do not refer to the odometry frame.
            self.track = CorridorTrack::new(self.config.min_width_m);
        }
        let result = match inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            Some(frame) => {
                let result = self.process_frame(&frame, now);
                if let Some(seen) = &self.seen {
                    outputs.draw(&CAMERA, frame.header, |overlay| overlay::draw(overlay, &self.sight, seen));
                }
                result
            }
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
        // Of the newest odometry, whose stamp it has.
        if let Some(corridor) = self.estimate().filter(|_| result != FrameResult::Nothing) {
            self.publish(&corridor, evidence, now, outputs);
        }
        if let Some(turn) = self.turn_at_end(pose, estimate.as_ref()) {
            return self.stamped(turn.with_evidence(last_frame));
        }
        let proposal = match (self.recovery(result, pose, now), estimate) {
            (None, Some(estimate)) => self.follow(&estimate, self.speed_share()).with_evidence(evidence),
            (Some(Recovery::Coast), Some(estimate)) => {
                let evidence = if self.approaches_wall() { last_frame } else { evidence };
                let share = self.last_found.map_or(0.5, |found| found.share.min(0.5));
                let coasting = self.follow(&estimate, share).with_evidence(evidence);
                if coasting.kind() == Some(Kind::Drive) {
                    coasting.with_reason(Reason::Coasting)
                } else {
                    coasting
                }
            }
            (Some(Recovery::TurnTo(heading)), _) => {
                let max_radps = SEARCH_RADPS.min(self.config.max_turn_radps);
                turn_in_place(pose.map_or(0.0, |pose| pose.theta), heading, max_radps)
                    .with_evidence(last_frame)
                    .with_reason(Reason::Searching)
            }
            (Some(Recovery::CreepAlong(heading)), _) => {
                self.creep_along(pose.map_or(0.0, |pose| pose.theta), heading).with_evidence(last_frame)
            }
            _ => Proposal::abstain(self.loss_reason(now)).with_evidence(evidence),
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
        self.seen = None;
        if !stamp.is_next(self.last_frame, now) {
            self.failure = Some(Reason::MalformedInput);
            return FrameResult::Nothing;
        }
        let pose = self.odometry.pose_at(stamp);
        let elapsed_s = self.last_frame.map_or(0.0, |last| stamp.seconds_after(last));
        self.track.predict(pose.map_or(Motion::Unknown { elapsed_s }, Motion::To));
        let poses = self.last_pose.zip(pose);
        self.sight.predict(poses);
        if let Some((from, to)) = poses {
            self.ahead.predict(&from.relative(&to));
        }
        (self.last_frame, self.last_pose) = (Some(stamp), pose);
        let size = self.sight.camera().pinhole.intrinsics().size();
        let Some(image) = frame.gray(size, &mut self.gray) else {
            self.failure = Some(Reason::MalformedInput);
            return FrameResult::NotFound;
        };
        if let (Some(floor), Some(pose)) = (&mut self.floor, pose) {
            floor.look(image, pose, stamp.as_secs_f64());
            if let Some(expected) = self.track.prediction() {
                self.track.take_floor(floor.reach_m(&pose, expected.heading));
            }
        }
        let seen = self.sight.look(image, self.track.prediction());
        self.seen = Some(seen);
        self.ahead.update(seen.wall, self.sight.nearest_floor_m(), elapsed_s);
        if let Some(pose) = pose.filter(|_| self.ahead.range_m().is_some()) {
            self.direction.see_wall(&pose);
        }
        self.is_mount_wrong = seen.is_mount_wrong;
        let before = self.evidence.map_or(Action::default(), |(_, action)| action);
        self.evidence = seen.probability.map(|p| (p, before.next(p)));
        let result = self.accept(&seen);
        if result == FrameResult::Found {
            self.last_found = Some(Found { stamp, pose, share: self.speed_share() });
            self.found_in_row += u32::from(!seen.is_far);
            if let (Some(pose), Ok(observation)) = (pose, &seen.observation)
                && self.found_in_row >= ESTABLISHED_FRAMES
            {
                self.direction.follow(&pose, observation.heading, stamp);
            }
        }
        result
    }

    /// Updates the state by what was seen, and sets the reason of a failure.
    fn accept(&mut self, seen: &Seen) -> FrameResult {
        let abstains = self.evidence.is_some_and(|(_, action)| action == Action::Abstain);
        let observation = match seen.observation {
            Ok(_) if seen.is_far && self.found_in_row > 0 => Err(Reason::NoVanishingPoint),
            Ok(seen) if self.is_doubtful(seen.heading) => Err(Reason::Gated),
            observation => observation,
        };
        let verdict = observation.map(|observation| self.track.update(&observation));
        let (failure, result) = match verdict {
            Ok(Verdict::Accepted) if seen.is_far || !abstains => (None, FrameResult::Found),
            Ok(Verdict::Gated) => (Some(Reason::Gated), FrameResult::NotFound),
            Err(_) if self.evidence.is_some() && !abstains => (None, FrameResult::Held),
            Ok(Verdict::Accepted) => (Some(self.no_corridor()), FrameResult::NotFound),
            Err(Reason::NoVanishingPoint) if abstains => (Some(self.no_corridor()), FrameResult::NotFound),
            Err(reason) => (Some(reason), FrameResult::NotFound),
        };
        self.failure = failure;
        result
    }

    /// Returns true if a corridor with this heading relative to its axis is not the one that was followed: who has followed one looks for
    /// it, and does not turn toward a direction that no point in view confirms.
    fn is_doubtful(&mut self, heading: f64) -> bool {
        let Some((pose, stamp)) = self.last_pose.zip(self.last_frame) else { return false };
        let is_lost = !self.track.has_heading();
        self.direction.leads_away(&pose, heading, stamp)
            || is_lost && !self.direction.is_confirmed(&pose, heading)
    }

    /// Returns why nothing is followed although lines meet.
    fn no_corridor(&self) -> Reason {
        if self.ahead.range_m().is_some() { Reason::WallAhead } else { Reason::NoCorridor }
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
        if result == FrameResult::Held && age_s > self.config.lost.coast_s {
            self.failure = Some(Reason::NoCorridor);
        }
        let is_late = self.last_frame.is_none_or(|last| now.seconds_after(last) > MIN_SILENT_S);
        if self.failure.is_none() && !is_late && age_s <= self.config.lost.coast_s.max(MIN_SILENT_S) {
            return None;
        }
        let is_silent = self.is_silent(now);
        if self.approaches_wall() && !is_silent {
            return Some(Recovery::Coast);
        }
        let driven_m = match (self.last_found.and_then(|found| found.pose), pose) {
            (Some(then), Some(pose)) => then.distance(&pose),
            _ => 0.0,
        };
        let loss = Loss {
            for_s: age_s,
            is_established: self.found_in_row >= ESTABLISHED_FRAMES,
            leads_on: self.direction.is_settled() && self.ahead.range_m().is_none(),
            for_m: driven_m,
            // Neither turning nor creeping on helps against a silent camera or malformed frames.
            heading: pose
                .map(|pose| pose.theta)
                .filter(|_| !is_silent && self.failure.is_some_and(|why| why != Reason::MalformedInput)),
            along: pose.and_then(|pose| self.direction.heading(&pose)),
            has_new_frame: matches!(result, FrameResult::NotFound | FrameResult::Held),
        };
        let recovery = self.recoverer.step(&loss, &self.config.lost);
        if recovery != Recovery::Coast {
            self.track.lose();
            // At least one: a corridor was followed.
            self.found_in_row = self.found_in_row.min(1);
        }
        if matches!(recovery, Recovery::TurnTo(_)) {
            // Every look of the search counts by itself.
            self.sight.forget();
        }
        Some(recovery)
    }

    /// Returns true while the robot comes to the end of a corridor that it has followed: the wall ahead hides its lines, and bounds
    /// how far odometry has to carry the estimate.
    fn approaches_wall(&self) -> bool {
        let is_before = |range_m: f64| range_m > self.config.stop_ahead_m;
        self.found_in_row >= ESTABLISHED_FRAMES
            && self.failure != Some(Reason::MalformedInput)
            && self.sight.knows_distances()
            && self.track.has_heading()
            && self.ahead.range_m().is_some_and(is_before)
    }

    /// Returns the reason for which there is no heading.
    fn loss_reason(&self, now: Time) -> Reason {
        let (is_silent, failure) = (self.is_silent(now), self.failure);
        // What the last frame lacked matters no more once no other comes; frames that are refused do come.
        let failure = failure.filter(|&why| !is_silent || why == Reason::MalformedInput);
        failure.unwrap_or(if is_silent { Reason::StaleInput } else { Reason::HeadingLost })
    }

    /// Returns true if no frame has come for some time.
    fn is_silent(&self, now: Time) -> bool {
        let silent_s = self.config.lost.coast_s.max(MIN_SILENT_S);
        self.last_frame.is_none_or(|last| now.seconds_after(last) > silent_s)
    }

    fn publish(&mut self, estimate: &Estimate, evidence: Time, now: Time, outputs: &mut Outputs<'_>) {
        let message = Corridor {
            stamp_ns: self.odometry.newest().map_or(now, |newest| newest.stamp).0,
            evidence_ns: evidence.0,
            sequence: self.sequence,
            heading_rad: estimate.heading,
            heading_sigma_rad: estimate.heading_sigma,
            left_m: estimate.walls.left_m.unwrap_or(f64::NAN),
            left_sigma_m: estimate.wall_sigmas_m[0],
            right_m: estimate.walls.right_m.map_or(f64::NAN, |signed_m| -signed_m),
            right_sigma_m: estimate.wall_sigmas_m[1],
            probability: self.evidence.map_or(presumed_confidence(estimate), |(probability, _)| probability),
        };
        self.sequence += 1;
        // The output may have no subscriber.
        let _ = outputs.publish(CORRIDOR.name, &message, &[]);
    }

    /// Stamps the proposal with the time to which the state was propagated.
    fn stamped(&self, mut proposal: Proposal) -> Proposal {
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }
}
