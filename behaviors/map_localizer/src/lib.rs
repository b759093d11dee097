//! Finds the robot on a wire-frame map, and follows a planned path to a goal.
//!
//! Ohya, Kosaka & Kak (1998): edges of the map that should be in view are matched with those of the picture, and what an old
//! picture shows corrects the position of its own instant. Differs from \[1\]: every picture is matched, and the covariance is
//! corrected with the pose.

pub mod association;
pub mod belief;
pub mod config;
pub mod consensus;
pub mod fix;
pub mod health;
pub mod history;
pub mod look_around;
pub mod matching;
pub mod motion;
pub mod projected_line;
pub mod pursuit;
pub mod relocalise;
pub mod route;

pub use config::Config;

use nalgebra::Point2;
use yamabico_core::behavior::{
    Behavior, BehaviorPlugin, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo, View,
};
use yamabico_core::camera::Pinhole;
use yamabico_core::config::FileKind;
use yamabico_core::geometry::{Pose2, Twist, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::map::{WIRE_FRAME_FILE, WireFrame};
use yamabico_core::message::{
    Axes, FrameHeader, Goal, Odometry, PathHeader, PathPoint, Pose, PoseStatus, Proposal, Reason,
};
use yamabico_core::odometry_track::FUTURE_TOLERANCE_S;
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;

use crate::belief::{Belief, difference};
use crate::fix::{Fix, Fixer};
use crate::health::{Advice, Health, INFLATION};
use crate::history::{CAPACITY, History, HistoryError};
use crate::look_around::LookAround;
use crate::matching::LineNoise;
use crate::motion::Increment;
use crate::pursuit::{JumpFilter, Pursuit, turn_towards};
use crate::relocalise::Relocaliser;
use crate::route::{MOST_CORNERS, Planner, Route, Station};

/// The plugin, to be listed by the program.
pub const PLUGIN: BehaviorPlugin = BehaviorPlugin::of::<MapLocalizer>();

/// The camera that sees the map's edges.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "pictures of the building");
/// Where the wheels say the robot is.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion between pictures");
/// Where to go.
pub const GOAL: Slot<Goal> = Slot::optional("goal", "a goal that replaces the route");
/// Where the robot is.
pub const POSE: Slot<Pose> = Slot::required("pose", "where the robot is on the map");
/// The way that it goes.
pub const PATH: Slot<PathHeader> =
    Slot::required("path", "the planned path, and where the robot stands on it");

/// Odometry older than this (s) is none.
const ODOMETRY_STALE_S: f64 = 0.3;
/// Without a fix for longer than this (s), the robot drives at half its speed.
const COAST_S: f64 = 1.0;
/// The least variances of a belief after a fix: 5 mm, 5 mm, 0.1 degrees.
const FLOOR: [f64; 3] = [25e-6, 25e-6, 3.046e-6];
/// A correction by more than this (m), or beyond this squared distance, waits for the next picture to agree ...
const LARGE: (f64, f64) = (0.5, 14.16);
/// ... within these (m, rad).
const AGREEING: (f64, f64) = (0.15, 0.05);
/// Turning by a radian changes what is seen as much as driving so far, metres.
const TURN_M: f64 = 0.5;
/// Pictures from one place still tell a little.
const MOST_REPETITION: f64 = 50.0;
/// With a belief wider than this (m, rad) the robot drives slowly.
const VAGUE: (f64, f64) = (0.2, 0.07);
/// Odometry that moves faster than the robot can by this factor has jumped ...
const JUMP_FACTOR: f64 = 3.0;
/// ... and says nothing of the motion but this (m, rad).
const JUMP_SIGMA: (f64, f64) = (0.1, 0.1);
/// A goal's heading is reached within this, rad.
const HEADING_TOLERANCE_RAD: f64 = 0.05;

/// Finds the robot on the map and drives it along its path.
#[derive(Clone, Debug)]
pub struct MapLocalizer {
    config: Config,
    law: Pursuit,
    clearance_m: f64,
    fastest: (f64, f64),
    fixer: Fixer,
    relocaliser: Relocaliser,
    history: History,
    health: Health,
    grey: GrayImage,
    odometry: Option<(Time, Pose2)>,
    driven_m: f64,
    looked_at_m: f64,
    /// Driven, and turned for [`TURN_M`] a radian.
    moved_m: f64,
    fixed_at_m: f64,
    last_picture: Option<Time>,
    last_fix: Option<Time>,
    begun: Option<Time>,
    held: Option<nalgebra::Vector3<f64>>,
    search: Option<LookAround>,
    route: Route,
    goal_heading: Option<f64>,
    progress_m: f64,
    refusal: Option<route::RouteError>,
    is_turning: bool,
    has_arrived: bool,
    jump: JumpFilter,
    last_fix_seen: Option<Fix>,
    sequence: u64,
}

impl Plugin for MapLocalizer {
    type Config = Config;
    const NAME: &'static str = "map-localizer";
    const SUMMARY: &'static str =
        "Finds the robot on a wire-frame map, and follows a planned path to a goal.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), GOAL.info()];
    const OUTPUTS: &'static [SlotInfo] = &[POSE.info(), PATH.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        config.check()?;
        let Some(SensorKind::Camera { intrinsics, distortion, mount, .. }) =
            setup.sensor(&CAMERA).map(|sensor| &sensor.kind)
        else {
            return Err(BuildError::new("inputs.camera", "needs a pinhole camera of the robot"));
        };
        if !intrinsics.is_valid() || !mount.is_finite() {
            return Err(BuildError::new(
                "inputs.camera",
                "the camera's intrinsics or mount are no usable numbers",
            ));
        }
        let map = WireFrame::read(&setup.folder.join(&config.map))
            .map_err(|error| BuildError::new("map", error.to_string()))?;
        let pinhole = Pinhole::new(*intrinsics, *distortion);
        let limits = &setup.robot.limits.speed;
        let mut localizer = Self {
            law: Pursuit {
                speed_mps: config.speed_mps,
                look_ahead_m: config.look_ahead_m,
                largest_turn_rad_s: config.largest_turn_rad_s,
            },
            clearance_m: setup.robot.radius_m + config.wall_margin_m,
            fastest: (JUMP_FACTOR * limits[0].max(0.1), JUMP_FACTOR * limits[2].max(0.1)),
            relocaliser: Relocaliser::new(&map, mount),
            fixer: Fixer::new(map, pinhole, *mount),
            history: History::new(CAPACITY, config.odometry.into()),
            health: Health::default(),
            grey: GrayImage::default(),
            odometry: None,
            driven_m: 0.0,
            looked_at_m: 0.0,
            moved_m: 0.0,
            fixed_at_m: 0.0,
            last_picture: None,
            last_fix: None,
            begun: None,
            held: None,
            search: None,
            route: Route::default(),
            goal_heading: None,
            progress_m: 0.0,
            refusal: None,
            is_turning: false,
            has_arrived: false,
            jump: JumpFilter::default(),
            last_fix_seen: None,
            sequence: 0,
            config,
        };
        localizer.plan_route()?;
        Ok(localizer)
    }
}

impl Behavior for MapLocalizer {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        let before = self.odometry.map(|(stamp, _)| stamp);
        for odometry in inputs.fresh(&ODOMETRY) {
            self.take_odometry(odometry.header, now);
        }
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.look(&frame, now);
        }
        if let Some(goal) = inputs.latest(&GOAL).filter(|_| inputs.is_fresh(&GOAL)) {
            self.take_goal(goal.header);
        }
        let newest = self.odometry.map(|(stamp, _)| stamp);
        if newest != before {
            self.publish(outputs);
        }
        let Some(newest) = newest else { return Proposal::abstain(Reason::NoInput) };
        let evidence = self.evidence();
        if now.seconds_after(newest) > ODOMETRY_STALE_S {
            return Proposal::abstain(Reason::StaleInput).with_evidence(evidence);
        }
        let mut proposal = self.drive(now).with_evidence(evidence);
        if self.search.is_some() {
            // What the search needs is a picture, whatever it shows.
            proposal = proposal.with_evidence(self.last_picture.unwrap_or(evidence));
        }
        proposal.stamp_ns = newest.0;
        proposal
    }
}

impl MapLocalizer {
    /// The belief at the newest odometry; `None` before any.
    #[must_use]
    pub fn belief(&self) -> Option<&Belief> {
        self.history.newest().map(|(_, belief)| belief)
    }

    /// How far the pose can be trusted, and why.
    #[must_use]
    pub fn status(&self) -> (PoseStatus, Reason) {
        (self.health.status(), self.health.reason())
    }

    /// What the last picture told; `None` before any.
    #[must_use]
    pub fn last_fix(&self) -> Option<&Fix> {
        self.last_fix_seen.as_ref()
    }

    /// What looks at the pictures: the expected edges, the segments and their pairs at the last one.
    #[must_use]
    pub fn fixer(&self) -> &Fixer {
        &self.fixer
    }

    /// The path that is followed.
    #[must_use]
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Oldest sensor data in the pose: the last picture that gave a fix, or the beginning.
    fn evidence(&self) -> Time {
        self.last_fix.or(self.begun).unwrap_or(Time::ZERO)
    }

    /// The route of the configuration, checked against the map.
    fn plan_route(&mut self) -> Result<(), BuildError> {
        if self.config.route.is_empty() {
            return Ok(());
        }
        let start = &self.config.start;
        let mut corners = vec![Point2::new(start.x_m, start.y_m)];
        corners.extend(self.config.route.iter().map(|&[x, y]| Point2::new(x, y)));
        let planner = Planner { map: self.fixer.map(), clearance_m: self.clearance_m };
        for (i, pair) in corners.windows(2).enumerate() {
            if !planner.is_free(pair[0], pair[1]) {
                return Err(BuildError::new(
                    "route",
                    format!(
                        "the way to its corner {} crosses a wall of the map, or passes one nearer than {:.2} m",
                        i + 1,
                        self.clearance_m
                    ),
                ));
            }
        }
        self.route = Route::new(corners, self.config.tolerance_m);
        Ok(())
    }

    fn take_odometry(&mut self, odometry: &Odometry, now: Time) {
        let (stamp, pose) = (Time(odometry.stamp_ns), Pose2::new(odometry.x, odometry.y, odometry.theta));
        if !pose.is_finite() || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.health.doubt(Reason::MalformedInput);
            return;
        }
        let Some((last_stamp, last_pose)) = self.odometry else {
            let start = &self.config.start;
            let pose_on_map = Pose2::new(start.x_m, start.y_m, start.heading_deg.to_radians());
            let belief = Belief::new(pose_on_map, start.sigma_m, start.sigma_deg.to_radians());
            self.history.start(stamp, belief);
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
        self.jump.pass(elapsed_s);
        if let Some((_, belief)) = self.history.newest()
            && self.health.watch(belief) == Advice::LookAround
        {
            self.begin_search();
        }
    }

    /// Adds doubt to the newest belief, m and rad.
    fn widen(&mut self, sigma_m: f64, sigma_rad: f64) {
        let Some((stamp, belief)) = self.history.newest() else { return };
        let mut belief = *belief;
        for (i, sigma) in [sigma_m, sigma_m, sigma_rad].into_iter().enumerate() {
            belief.covariance[(i, i)] += sigma * sigma;
        }
        self.history.start(stamp, belief);
    }

    fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
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
        let taken = match self.grey.view_of_frame(frame, self.fixer.pinhole().intrinsics()) {
            Some(image) => self.fixer.take(image),
            None => Err(Reason::MalformedInput),
        };
        if let Err(reason) = taken {
            self.health.miss(reason);
            self.search_in_vain();
            return;
        }
        if self.search.is_some() {
            self.search(stamp, &prior);
        } else {
            self.fix(stamp, &prior);
        }
    }

    fn fix(&mut self, stamp: Time, prior: &Belief) {
        let fix = self.fixer.fix(prior, &self.noise());
        self.last_fix_seen = Some(fix);
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

    /// Writes a result into the history, and tells the steering of the jump that it makes.
    fn apply(&mut self, stamp: Time, prior: &Belief, posterior: Belief) -> bool {
        if !posterior.is_sound() {
            self.health.doubt(Reason::Inconsistent);
            return false;
        }
        let before = self.station().map(|station| station.lateral_error_m);
        let applied = if self.config.retroactive {
            self.history.correct(stamp, posterior)
        } else {
            self.history.correct_newest(stamp, prior, &posterior)
        };
        if let Err(error) = applied {
            self.health.miss(reason(error));
            return false;
        }
        let after = self.station().map(|station| station.lateral_error_m);
        if let (Some(before), Some(after)) = (before, after) {
            self.jump.jump(after - before);
        }
        true
    }

    fn noise(&self) -> LineNoise {
        LineNoise {
            sigma_px: self.config.sigma_px,
            map_sigma_m: self.config.map_sigma_m,
            scale: self.health.noise_scale(),
            repetition: self.repetition(),
        }
    }

    /// By how much a picture tells less than its lines could, because those of the picture before stood in nearly the same
    /// places and err alike.
    fn repetition(&self) -> f64 {
        let moved_m = self.moved_m - self.fixed_at_m;
        if self.last_fix.is_none() {
            1.0
        } else {
            (self.config.correlation_m / moved_m).clamp(1.0, MOST_REPETITION)
        }
    }

    fn begin_search(&mut self) {
        if let Some((_, pose)) = self.odometry {
            self.search = Some(LookAround::begin(pose.theta));
        }
    }

    fn search(&mut self, stamp: Time, prior: &Belief) {
        let noise = LineNoise { scale: 1.0, repetition: 1.0, ..self.noise() };
        match self.relocaliser.find(&mut self.fixer, prior, &noise) {
            Some(found) => {
                if self.apply(stamp, prior, found) {
                    self.search = None;
                    self.held = None;
                    self.health.found();
                    self.last_fix = Some(stamp);
                    self.progress_m = 0.0;
                }
            }
            None => self.search_in_vain(),
        }
    }

    fn search_in_vain(&mut self) {
        if let (Some(search), Some((_, pose))) = (&mut self.search, self.odometry) {
            search.picture(pose.theta);
        }
    }

    fn take_goal(&mut self, goal: &Goal) {
        let Some(belief) = self.belief() else { return };
        let (from, to) = (belief.pose.position(), Point2::new(goal.x, goal.y));
        let planner = Planner { map: self.fixer.map(), clearance_m: self.clearance_m };
        let known: Vec<Point2<f64>> = self
            .config
            .route
            .iter()
            .map(|&[x, y]| Point2::new(x, y))
            .chain([Point2::new(self.config.start.x_m, self.config.start.y_m)])
            .take(MOST_CORNERS - 2)
            .collect();
        match planner.path(from, &known, to) {
            Ok(corners) => {
                let is_usable = goal.tolerance_m.is_finite() && goal.tolerance_m > 0.0;
                let tolerance_m = if is_usable { goal.tolerance_m } else { self.config.tolerance_m };
                self.route = Route::new(corners, tolerance_m);
                self.goal_heading = goal.theta.is_finite().then_some(goal.theta);
                self.progress_m = 0.0;
                self.has_arrived = false;
                self.jump = JumpFilter::default();
                self.refusal = None;
            }
            Err(error) => self.refusal = Some(error),
        }
    }

    fn station(&self) -> Option<Station> {
        self.route.station(&self.belief()?.pose, self.progress_m)
    }

    fn drive(&mut self, now: Time) -> Proposal {
        if self.search.is_some() {
            return self.look_around();
        }
        let (Some(belief), Some(station)) = (self.belief().copied(), self.station()) else {
            return Proposal::abstain(Reason::None).with_note(format_args!("no route and no goal"));
        };
        self.progress_m = self.progress_m.max(station.progress_m - 0.5);
        let tolerance_m = self.route.tolerance_m;
        self.has_arrived |= station.distance_m <= tolerance_m && station.to_go_m <= tolerance_m;
        if self.has_arrived {
            return self.stand(&belief);
        }
        let share = self.share_of_speed(&belief, now);
        let aside_m = self.jump.aside_m();
        let twist = self.law.steer(&self.route, &station, &belief.pose, aside_m, share, &mut self.is_turning);
        let proposal = Proposal::drive(Axes::PLANAR, twist)
            .because(self.health.reason())
            .with_confidence(1.0 / (1.0 + (belief.sigma_xy_m() / 0.1).powi(2)));
        let proposal = if self.is_turning { proposal.uncoupled() } else { proposal };
        match self.refusal {
            Some(refusal) => proposal.with_note(format_args!("goal refused, old route kept: {refusal}")),
            None => proposal.with_note(format_args!(
                "{:.2} m to go, {:+.2} m left of the path, {:+.1} deg",
                station.to_go_m,
                station.lateral_error_m,
                station.heading_error_rad.to_degrees()
            )),
        }
    }

    /// At the goal: turned to its heading, then still.
    fn stand(&self, belief: &Belief) -> Proposal {
        let error = self.goal_heading.map_or(0.0, |goal| angle_difference(goal, belief.pose.theta));
        let twist = if error.abs() > HEADING_TOLERANCE_RAD {
            turn_towards(belief.pose.theta, belief.pose.theta + error, self.config.largest_turn_rad_s)
        } else {
            Twist::ZERO
        };
        Proposal::drive(Axes::PLANAR, twist).because(Reason::Nominal).with_note(format_args!("arrived"))
    }

    fn look_around(&self) -> Proposal {
        let heading = self.odometry.map_or(0.0, |(_, pose)| pose.theta);
        match self.search.and_then(|search| search.turn(heading)) {
            Some(twist) => Proposal::drive(Axes::PLANAR, twist)
                .uncoupled()
                .because(Reason::Searching)
                .with_note(format_args!("pose lost, looking around")),
            None => Proposal::halt(Axes::PLANAR, Reason::Lost)
                .with_note(format_args!("pose lost, and nothing of the map is recognised")),
        }
    }

    /// The share of the cruising speed that the pose is good for.
    fn share_of_speed(&self, belief: &Belief, now: Time) -> f64 {
        let of_status: f64 = match self.health.status() {
            PoseStatus::Tracking => 1.0,
            _ => 0.5,
        };
        let age_s = self.last_fix.map_or(f64::INFINITY, |fix| now.seconds_after(fix));
        let is_coasting = self.health.status() == PoseStatus::Coasting && age_s <= COAST_S;
        let is_vague = belief.sigma_xy_m() > VAGUE.0 || belief.sigma_theta_rad() > VAGUE.1;
        let share = if is_coasting { 1.0 } else { of_status };
        if is_vague { share.min(0.4) } else { share }
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some((stamp, belief)) = self.history.newest() else { return };
        let (stamp_ns, evidence_ns) = (stamp.0, self.evidence().0);
        self.sequence += 1;
        // How far the map's edges are off together is in every picture: it does not grow less with more of them.
        let variance = self.config.map_sigma_m.powi(2);
        let of_map = [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 0.0];
        let pose = Pose {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            x: belief.pose.x,
            y: belief.pose.y,
            theta: belief.pose.theta,
            covariance: std::array::from_fn(|i| belief.covariance[(i / 3, i % 3)] + of_map[i]),
            status: self.health.status().code(),
            reserved: 0,
        };
        // Nobody listens, or the bus is full: the proposal counts all the same.
        let _ = outputs.publish(POSE.name, &pose, &[]);
        let Some(station) = self.station() else { return };
        let header = PathHeader {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            lateral_error_m: station.lateral_error_m,
            heading_error_rad: station.heading_error_rad,
            progress_m: station.progress_m,
        };
        let mut points = [PathPoint::default(); MOST_CORNERS];
        let corners = self.route.corners();
        for (point, corner) in points.iter_mut().zip(corners) {
            *point = PathPoint { x: corner.x, y: corner.y };
        }
        let _ = outputs.publish(PATH.name, &header, &points[..corners.len().min(MOST_CORNERS)]);
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
