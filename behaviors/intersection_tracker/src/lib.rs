//! Finds the two vertical edges where the walls of a corridor end, tracks them and steers between them.
//!
//! ```
//! use yamabico_core::camera::{Intrinsics, Mount};
//! use yamabico_core::message::{Kind, Reason};
//! use yamabico_core::testing::{Bench, camera_setup};
//! use yamabico_intersection_tracker::IntersectionTracker;
//!
//! let camera = camera_setup(Intrinsics::from_horizontal_fov(640, 480, 1.0), Mount::level(0.6));
//! let mut bench = Bench::<IntersectionTracker>::new("speed_mps = 0.4", camera)?;
//! let proposal = bench.at(0.1).propose(); // no frame yet
//! assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Abstain), Some(Reason::NoInput)));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```
//!
//! Kweon et al. (1991), sections 3.5 and 4. Differs from the paper: exact geometry, and a tracker that estimates the positions
//! of the edges, validates every match, and reports their loss.

pub mod config;
pub mod edge_template;
pub mod finder;
pub mod followed_edge;
pub mod foot;
pub mod frame;
pub mod handover;
pub mod landmarks;
pub mod overlay;
pub mod pair;
pub mod snap;
pub mod steering;
pub mod strip;
pub mod template;
pub mod track;
pub mod wall_foot;

pub use config::Config;
pub use landmarks::Ahead;

use nalgebra::Point2;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::{Axes, FrameHeader, Imu, Intersection, Odometry, Proposal, Reason, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::overlay::Overlay;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver, CorridorPrediction};
use yamabico_vision::vanishing_point::VanishingPointError;

use crate::finder::{EndFinder, FinderRule, Side, WallEnd};
use crate::frame::Frame;
use crate::handover::Handover;
use crate::steering::{is_confirmed, steer};
use crate::track::{IntersectionTrack, Sides};

/// Input: frames of the camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the corridor ahead");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::optional("odometry", "motion between frames");
/// Input: the gyro.
pub const IMU: Slot<Imu> = Slot::optional("imu", "turn rate, in place of that of the wheels");
/// Output: the tracked intersection.
pub const INTERSECTION: Slot<Intersection> =
    Slot::required("intersection", "bearing and distance of the intersection ahead");

/// Age above which odometry and frames are stale, s.
const STALE_S: f64 = 0.3;
/// Time for which a loss is reported, s.
const LOSS_REPORTED_S: f64 = 2.0;
/// Age up to which a measured heading of the corridor serves as prediction, s.
const AXIS_KEPT_S: f64 = 3.0;
/// Standard deviation of that prediction, rad.
const AXIS_SIGMA_RAD: f64 = 0.03;
/// Number of frames between two comparisons of the tracked edges with the ends of the walls.
const REVIEW_FRAMES: u32 = 5;
/// Number of consecutive contradicting comparisons after which the edges are dropped.
const CONTRADICTIONS: u32 = 3;
/// Hysteresis of the handover: additional distance (m) and border (px) at which an intersection is found again.
const APART: (f64, f64) = (0.3, 10.0);
/// Number of frames after which an unconfirmed pair is dropped.
const UNCONFIRMED_FRAMES: u32 = 20;
/// Distance by which a new pair must be nearer to replace an unconfirmed one, m.
const NEARER_M: f64 = 0.8;
/// The behavior: steers toward the middle between the two edges where the walls of a corridor end.
#[derive(Clone, Debug)]
pub struct IntersectionTracker {
    config: Config,
    observer: CorridorObserver,
    finder: EndFinder,
    rule: FinderRule,
    track: IntersectionTrack,
    odometry: OdometryTrack,
    gray: GrayImage,
    sequence: u64,
    last_frame: Option<Frame>,
    last_seen: Option<Time>,
    /// Angle of the corridor's axis in the odometry frame, and the time of its measurement.
    axis: Option<(f64, Time)>,
    lost_at: Option<Time>,
    /// Intersection that the robot has reached and not yet passed.
    handed_over: Option<Handover>,
    failure: Option<Reason>,
    /// True if the ends of the walls were looked for in the last frame.
    has_looked_for_ends: bool,
}

impl Plugin for IntersectionTracker {
    type Config = Config;
    const NAME: &'static str = "intersection-tracker";
    const SUMMARY: &'static str =
        "Steers toward the middle between the edges where the walls of a corridor end.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), IMU.info()];
    const OUTPUTS: &'static [SlotInfo] = &[INTERSECTION.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        config.check()?;
        let MountedPinhole { pinhole, mount, calibration, .. } = setup.pinhole(&CAMERA)?;
        if calibration == Calibration::Guessed || mount.z <= 0.0 {
            return Err(ParameterError::new(
                "inputs.camera",
                "needs a camera with measured intrinsics, above the floor: distances come from its height",
            ));
        }
        let camera = CorridorCamera {
            pinhole,
            mount,
            calibration,
            horizon_sigma_rad: config.horizon_sigma_deg.to_radians(),
        };
        let rule = FloorLineRule { min_contrast: config.floor_contrast, ..FloorLineRule::default() };
        Ok(Self {
            observer: CorridorObserver::new(camera, rule),
            finder: EndFinder::default(),
            rule: FinderRule {
                range_m: [config.handover_m + APART.0, config.max_range_m],
                border_px: config.border_px + APART.1,
                pair_m: config.pair_m,
            },
            track: IntersectionTrack::new(pinhole.intrinsics().width, &config),
            config,
            odometry: OdometryTrack::default(),
            gray: GrayImage::default(),
            sequence: 0,
            last_frame: None,
            last_seen: None,
            axis: None,
            lost_at: None,
            handed_over: None,
            failure: None,
            has_looked_for_ends: false,
        })
    }
}

impl Behavior for IntersectionTracker {
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
            self.track.lose();
        }
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.process_frame(&frame, now);
            if self.last_frame.is_some_and(|last| last.stamp == Time(frame.header.stamp_ns)) {
                outputs.draw(&CAMERA, frame.header, |overlay| self.draw(overlay));
            }
        }
        let Some(frame) = self.last_frame else {
            return Proposal::abstain(self.failure.unwrap_or(Reason::NoInput));
        };
        if now.seconds_after(frame.stamp) > STALE_S {
            return Proposal::abstain(Reason::StaleInput).with_evidence(frame.stamp);
        }
        let pose = match self.odometry.newest() {
            None => Pose2::IDENTITY,
            Some(newest) if now.seconds_after(newest.stamp) > STALE_S => {
                return Proposal::abstain(Reason::StaleInput).with_evidence(frame.stamp);
            }
            Some(_) => self.odometry.pose_at(now).unwrap_or_default(),
        };
        let mut proposal = match self.ahead(&pose) {
            Some(ahead) => {
                if self.is_confirmed() {
                    self.publish(&ahead, frame.stamp, now, outputs);
                }
                steer(&ahead, &self.track, &self.config)
            }
            None => self.nothing_ahead(now),
        };
        proposal = proposal.with_evidence(self.last_seen.unwrap_or(frame.stamp));
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }
}

impl IntersectionTracker {
    /// Returns the tracker, for inspection.
    #[must_use]
    pub fn track(&self) -> &IntersectionTrack {
        &self.track
    }

    /// Returns the intersection relative to a robot at `pose` in the odometry frame; `None` while none is tracked.
    #[must_use]
    pub fn ahead(&self, pose: &Pose2) -> Option<Ahead> {
        let landmarks = self.track.landmarks()?;
        let mount = &self.observer.camera().mount;
        let [left, right] = Side::BOTH.map(|side| landmarks.bearing(pose, side, mount));
        let (middle, sigma_m) = landmarks.middle(pose);
        Some(Ahead { bearing: 0.5 * (left + right), distance_m: middle.x, sigma_m })
    }

    /// Draws what was seen in the last frame.
    fn draw(&self, overlay: &mut Overlay) {
        if self.has_looked_for_ends {
            overlay::draw_ends(overlay, &self.observer, self.finder.ends());
        }
        let pose = self.last_frame.and_then(|frame| frame.pose).unwrap_or_default();
        overlay::draw_track(overlay, &self.observer, &self.track, &pose, self.ahead(&pose).as_ref());
    }

    fn process_frame(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        if !stamp.is_next(self.last_frame.map(|last| last.stamp), now) {
            self.failure = Some(Reason::MalformedInput);
            return;
        }
        let taken = Frame { stamp, pose: self.odometry.pose_at(stamp) };
        let motion = taken.motion_since(self.last_frame.as_ref());
        self.last_frame = Some(taken);
        self.has_looked_for_ends = false;
        match motion {
            Ok(motion) => self.track.predict(motion),
            Err(reason) => {
                self.track.lose();
                self.lost_at = None;
                self.failure = Some(reason);
            }
        }
        let mut gray = std::mem::take(&mut self.gray);
        match frame.gray(self.observer.camera().pinhole.intrinsics().size(), &mut gray) {
            Some(image) => self.process_image(image, &taken),
            None => self.failure = Some(Reason::MalformedInput),
        }
        self.gray = gray;
        if self.track.landmarks().is_some() && self.track.drop_lost(&taken.pose.unwrap_or_default()) {
            self.lost_at = Some(stamp);
        }
    }

    fn process_image(&mut self, image: ImageView<'_>, taken: &Frame) {
        let pose = taken.pose.unwrap_or_default();
        let camera = *self.observer.camera();
        if self.hands_over(&pose, &camera) {
            self.handed_over = self.track.landmarks().map(|landmarks| Handover {
                point: nalgebra::center(&landmarks.point(Side::Left), &landmarks.point(Side::Right)),
                stamp: taken.stamp,
            });
            self.track.lose();
        }
        if self.handed_over.is_some_and(|handover| !handover.is_passed(taken)) {
            self.failure = None;
            return;
        }
        self.handed_over = None;
        let seen = self.track.follow(image, &pose, &camera);
        self.failure = None;
        let is_due = self.track.frames().is_multiple_of(REVIEW_FRAMES);
        if taken.pose.is_none() || !self.is_confirmed() || self.track.needs_ends() || is_due {
            self.failure = self.find_ends(image, taken, &pose).err();
        }
        if seen != Sides::None || Side::BOTH.iter().any(|&side| self.track.observed_at(side).is_some()) {
            self.last_seen = Some(taken.stamp);
            self.lost_at = None;
        }
    }

    fn hands_over(&self, pose: &Pose2, camera: &CorridorCamera) -> bool {
        let is_near =
            self.ahead(pose).is_some_and(|ahead| ahead.distance_m - camera.mount.x < self.config.handover_m);
        is_near || self.track.leaves_image(pose, camera)
    }

    /// Finds the ends of the walls, for a new track or for edges that the track misses.
    fn find_ends(&mut self, image: ImageView<'_>, taken: &Frame, pose: &Pose2) -> Result<(), Reason> {
        let expectation = self.axis.filter(|_| taken.pose.is_some()).and_then(|(axis, seen)| {
            let is_fresh = taken.stamp.seconds_after(seen) < AXIS_KEPT_S;
            let heading = wrap_angle(pose.theta - axis);
            is_fresh.then_some(CorridorPrediction {
                heading,
                heading_sigma: AXIS_SIGMA_RAD,
                walls: [None; 2],
                floor_m: [0.0; 2],
            })
        });
        let sighting = self.observer.observe(image, expectation).map_err(heading_failure)?;
        self.has_looked_for_ends = true;
        self.axis = Some((wrap_angle(pose.theta - sighting.heading), taken.stamp));
        let camera = *self.observer.camera();
        self.finder.find(image, &self.observer, &sighting, &self.rule);
        let pair = self.finder.pair(&self.rule);
        if self.track.landmarks().is_some() {
            let is_given_up = self.compare(image, pose);
            if self.is_confirmed() && !is_given_up {
                return Ok(());
            }
            if is_given_up || self.track.frames() > UNCONFIRMED_FRAMES {
                self.track.lose();
            }
        }
        let tracked_m = self.ahead(pose).map(|ahead| ahead.distance_m);
        let Some(pair) = pair else {
            // A single end may belong to a door.
            return if self.finder.ends().is_empty() { Ok(()) } else { Err(Reason::OneSided) };
        };
        let is_nearer = tracked_m.is_none_or(|tracked| middle(&pair).x < tracked - NEARER_M);
        if is_nearer || self.track.sides() != Sides::Both {
            return self.track.begin_pair(image, pose, &camera, &pair);
        }
        Ok(())
    }

    /// Compares the tracked edges with the ends of the walls in the image. Returns true if the walls ended elsewhere too
    /// often.
    fn compare(&mut self, image: ImageView<'_>, pose: &Pose2) -> bool {
        let camera = *self.observer.camera();
        let tracked_m = self.ahead(pose).map_or(f64::INFINITY, |ahead| ahead.distance_m);
        let is_nearer = |pair: &[WallEnd; 2]| middle(pair).x < tracked_m - NEARER_M;
        let is_seen_nearer = self.finder.pair(&self.rule).is_some_and(|pair| is_nearer(&pair));
        let agreeing = self.finder.pairs(&self.rule).find(|pair| self.track.agrees(pose, pair));
        if let Some(pair) = agreeing.filter(|_| !is_seen_nearer) {
            if !self.is_confirmed() || self.track.needs_ends() {
                for end in &pair {
                    self.track.reacquire(image, pose, &camera, end);
                }
            }
            for end in &pair {
                self.track.correct(image, pose, &camera, end);
            }
            if self.track.sides() == Sides::Both {
                self.track.confirm();
            }
            return false;
        }
        // Corners behind an intersection are no evidence about the tracked edges.
        let is_before = |pair: [WallEnd; 2]| middle(&pair).x < tracked_m + NEARER_M;
        self.finder.pairs(&self.rule).any(is_before) && self.track.contradict() >= CONTRADICTIONS
    }

    fn publish(&mut self, ahead: &Ahead, frame: Time, now: Time, outputs: &mut Outputs<'_>) {
        let message = Intersection {
            stamp_ns: self.odometry.newest().map_or(now, |newest| newest.stamp).0,
            evidence_ns: self.last_seen.unwrap_or(frame).0,
            sequence: self.sequence,
            bearing_rad: ahead.bearing,
            distance_m: ahead.distance_m,
            sigma_m: ahead.sigma_m,
        };
        self.sequence += 1;
        // The output may have no subscriber.
        let _ = outputs.publish(INTERSECTION.name, &message, &[]);
    }

    fn nothing_ahead(&self, now: Time) -> Proposal {
        let is_mourned = self.lost_at.is_some_and(|lost| now.seconds_after(lost) < LOSS_REPORTED_S);
        if is_mourned {
            return Proposal::abstain(Reason::IntersectionLost);
        }
        if let Some(reason) = self.failure {
            return Proposal::abstain(reason);
        }
        match self.handed_over {
            Some(_) => Proposal::abstain(Reason::Nominal).with_note(format_args!("handed over")),
            None => Proposal::abstain(Reason::Clear),
        }
    }

    fn is_confirmed(&self) -> bool {
        is_confirmed(&self.track, &self.config)
    }
}

fn middle(pair: &[WallEnd; 2]) -> Point2<f64> {
    nalgebra::center(&pair[0].point_in_robot, &pair[1].point_in_robot)
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
