//! Localizes the robot on a map and follows a planned path to a goal.
//!
//! Ohya, Kosaka & Kak (1998) \[1\]: an image corrects the pose at its own capture time. Differs from \[1\]: every image
//! is used, and the covariance is corrected with the pose. A [`fix::PoseFinder`] extracts the correction from the
//! image: from the edges of a [wire frame](wire_frame), from [azimuths](azimuth) of vertical edges or from the [outline
//! of the floor](floor_outline). The [`tracker`] applies it retroactively, and the [`path_follower`] drives.
//!
//! ```
//! # use yamabico_core::{behavior::Setup, message::Odometry, testing::Bench, time::Time};
//! # use yamabico_map_localizer::{MapLocalizer, ODOMETRY};
//! let parameters = "method = 'dead-reckoning'\nroute = [[3.0, 0.0]]";
//! let mut bench = Bench::<MapLocalizer>::new(parameters, Setup::default())?;
//!
//! let odometry = Odometry { stamp_ns: Time::from_secs_f64(1.0).0, ..Odometry::default() };
//! let proposal = bench.at(1.0).feed(&ODOMETRY, &odometry, &[]).propose();
//! assert!(proposal.twist.linear > 0.0, "drives toward the goal");
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```

mod agreement;
pub mod azimuth;
pub mod belief;
pub mod config;
pub mod dead_reckoning;

pub mod finder;
pub mod fix;
pub mod floor_outline;
pub mod health;
pub mod history;
pub mod look_around;
pub mod motion;
pub mod obstacles;
pub mod path_follower;
pub mod pursuit;
pub mod route;
pub mod slip;
pub mod tracker;
pub mod wire_frame;

pub use config::Config;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::geometry::Twist;
use yamabico_core::message::{
    Axes, FrameHeader, Goal, ObstaclesHeader, Odometry, PathHeader, PathPoint, Pose, PoseStatus, Proposal,
    Reason,
};
use yamabico_core::parameters::FileKind;
use yamabico_core::time::Time;
use yamabico_vision::azimuth_map::EDGE_MAP_FILE;
use yamabico_vision::floor_color_file::FLOOR_COLORS_FILE;
use yamabico_vision::map::WIRE_FRAME_FILE;

use crate::belief::Belief;

use crate::finder::Finder;
use crate::fix::Fix;
use crate::floor_outline::FLOOR_PLAN_FILE;
use crate::obstacles::Obstacles;
use crate::path_follower::{PathFollower, PathState, Polygon};
use crate::route::{MAX_CORNERS, Route};
use crate::tracker::{PoseState, Tracker};

/// Camera whose images are matched with the map.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "images of the surroundings");
/// Odometry that propagates the pose between images.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion between images");
/// Goal in the map frame; optional.
pub const GOAL: Slot<Goal> = Slot::optional("goal", "goal that replaces the route");
/// Pose estimate in the map frame.
pub const POSE: Slot<Pose> = Slot::required("pose", "pose estimate in the map frame");
/// Planned path and the robot's progress along it.
pub const PATH: Slot<PathHeader> = Slot::required("path", "planned path and the robot's progress along it");

/// Obstacles that are not on the map.
pub const OBSTACLES: Slot<ObstaclesHeader> = Slot::required("obstacles", "obstacles that are not on the map");

/// Maximum intrusion of an obstacle into the planned clearance that triggers no new path, m.
const REPLAN_M: f64 = 0.03;
/// Maximum age of odometry, s.
const ODOMETRY_STALE_S: f64 = 0.3;
/// Time without a fix after which the robot drives at half its speed, s.
const COAST_S: f64 = 1.0;
/// Standard deviations of position (m) and heading (rad) above which the robot slows down.
const VAGUE_SIGMA: (f64, f64) = (0.2, 0.07);

/// Behavior that localizes the robot on a map and drives it along a path.
#[derive(Clone, Debug)]
pub struct MapLocalizer {
    tracker: Tracker,
    follower: PathFollower,
    /// Goal that no path was planned to yet, because the pose is not known.
    waiting_goal: Option<Goal>,
    obstacles: Obstacles,
    /// Obstacles inflated by slightly less than the robot's radius: the current path must not cross them.
    hard: Vec<Polygon>,
    /// Obstacles inflated by the robot's radius: a new path must not cross them.
    inflated: Vec<Polygon>,
    radius_m: f64,
    max_turn_radps: f64,
    /// Age of the last image above which the camera counts as silent, s.
    max_image_age_s: f64,
    map_variance: f64,
    sequence: u64,
    obstacle_sequence: u64,
}

impl Plugin for MapLocalizer {
    type Config = Config;
    const NAME: &'static str = "map-localizer";
    const SUMMARY: &'static str = "Localizes the robot on a map and follows a planned path to a goal.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), GOAL.info()];
    const OUTPUTS: &'static [SlotInfo] = &[POSE.info(), PATH.info(), OBSTACLES.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE, EDGE_MAP_FILE, FLOOR_PLAN_FILE, FLOOR_COLORS_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        let finder = Finder::new(&config, setup)?;
        // The last image grows this old before the next one arrives.
        let image_age_s = setup.sensor(&CAMERA).map_or(0.0, |camera| camera.period_s + camera.latency_s);
        Ok(Self {
            follower: PathFollower::new(&config, finder.method().walls(), setup.robot.radius_m)?,
            tracker: Tracker::new(&config, finder, &setup.robot),
            waiting_goal: None,
            obstacles: Obstacles::default(),
            hard: Vec::new(),
            inflated: Vec::new(),
            radius_m: setup.robot.radius_m,
            max_turn_radps: config.max_turn_radps,
            max_image_age_s: image_age_s + COAST_S,
            map_variance: config.map_sigma_m.powi(2),
            sequence: 0,
            obstacle_sequence: 0,
        })
    }
}

impl Behavior for MapLocalizer {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        let before = self.stamp();
        for odometry in inputs.fresh(&ODOMETRY) {
            self.tracker.take_odometry(odometry.header, now);
        }
        self.process_image(inputs, outputs);
        self.tracker.check_camera(now, self.max_image_age_s);
        if let Some(goal) = inputs.latest(&GOAL).filter(|_| inputs.is_fresh(&GOAL)) {
            self.waiting_goal = Some(*goal.header);
        }
        self.plan();
        let Some(newest) = self.stamp() else { return Proposal::abstain(Reason::NoInput) };
        if before != Some(newest) {
            self.follower.advance_time(before.map_or(0.0, |before| newest.seconds_after(before)));
            self.publish(outputs);
        }
        let evidence = self.tracker.evidence();
        if now.seconds_after(newest) > ODOMETRY_STALE_S {
            return Proposal::abstain(Reason::StaleInput).with_evidence(evidence);
        }
        let mut proposal = match self.tracker.search() {
            // The search depends on any recent image, not on the last fix.
            Some((search, heading)) if self.waiting_goal.is_some() || self.follower.is_underway() => {
                let image = self.tracker.last_image_at().unwrap_or(evidence);
                look_around(search.next_turn(heading, self.max_turn_radps)).with_evidence(image)
            }
            Some(_) => Proposal::abstain(Reason::Lost)
                .with_note(format_args!("pose lost, and no goal to drive to"))
                .with_evidence(evidence),
            None => self.drive(now).with_evidence(evidence),
        };
        proposal.stamp_ns = newest.0;
        proposal
    }

    fn save_state(&self, state: &mut Vec<u8>) {
        if let Some(pose) = self.tracker.state() {
            // Writing to a vector cannot fail, and an incomplete state is ignored on restore.
            let _ = serde_json::to_writer(state, &(pose, self.follower.state()));
        }
    }

    fn restore_state(&mut self, state: &[u8]) {
        if let Ok((pose, path)) = serde_json::from_slice::<(PoseState, PathState<'_>)>(state) {
            self.tracker.restore(&pose);
            self.follower.restore(path);
        }
    }
}

impl MapLocalizer {
    /// Returns the belief at the newest odometry; `None` before any.
    #[must_use]
    pub fn belief(&self) -> Option<&Belief> {
        self.tracker.newest().map(|(_, belief)| belief)
    }

    /// Returns the status of the pose estimate and its reason.
    #[must_use]
    pub fn status(&self) -> (PoseStatus, Reason) {
        self.tracker.status()
    }

    /// Returns the result of matching the last image; `None` before any.
    #[must_use]
    pub fn last_fix(&self) -> Option<&Fix> {
        self.tracker.last_fix()
    }

    /// Returns the finder that matches images with the map.
    #[must_use]
    pub fn finder(&self) -> &Finder {
        self.tracker.finder()
    }

    /// Returns the path that is followed.
    #[must_use]
    pub fn route(&self) -> &Route {
        self.follower.route()
    }

    /// Plans a path to the goal that waits, once the pose is known.
    fn plan(&mut self) {
        if self.tracker.search().is_none()
            && let Some((_, belief)) = self.tracker.newest()
            && let Some(goal) = self.waiting_goal.take()
        {
            self.follower.set_goal(&goal, belief, self.tracker.finder().method().walls());
        }
    }

    fn stamp(&self) -> Option<Time> {
        self.tracker.newest().map(|(stamp, _)| stamp)
    }

    /// Processes a new image and informs the path follower of the resulting jump of the pose.
    fn process_image(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) else { return };
        let was_lost = self.tracker.search().is_some();
        let before = self.lateral_error_m();
        self.tracker.process_image(&frame, inputs.now());
        if self.tracker.last_image_at() == Some(Time(frame.header.stamp_ns)) {
            outputs.draw(&CAMERA, frame.header, |overlay| self.tracker.finder().method().draw(overlay));
        }
        if was_lost && self.tracker.search().is_none() {
            self.follower.forget_progress();
        } else if let (Some(before), Some(after)) = (before, self.lateral_error_m()) {
            self.follower.add_jump(after - before);
        }
        self.avoid(Time(frame.header.stamp_ns), outputs);
    }

    /// Publishes the obstacles that are not on the map, in the robot frame, and plans a path around them.
    fn avoid(&mut self, image: Time, outputs: &mut Outputs<'_>) {
        let edges = self.tracker.finder().method().unknown_edges();
        if edges.is_empty() && self.obstacles.list().is_empty() {
            return;
        }
        let Some((stamp, belief)) = self.tracker.newest() else { return };
        self.obstacles.group(edges, &belief.pose);
        if self.tracker.search().is_none() {
            self.obstacles.inflate(edges, self.radius_m - REPLAN_M, &mut self.hard);
            self.obstacles.inflate(edges, self.radius_m, &mut self.inflated);
            self.follower.avoid(&self.hard, &self.inflated, belief);
        }
        // An image without a fix does not show where they are.
        if self.tracker.unknown_edges_at() != Some(image) {
            return;
        }
        let header =
            ObstaclesHeader { stamp_ns: stamp.0, evidence_ns: image.0, sequence: self.obstacle_sequence };
        // A failed publication does not affect driving.
        if outputs.publish(OBSTACLES.name, &header, self.obstacles.list()).is_ok() {
            self.obstacle_sequence += 1;
        }
    }

    fn lateral_error_m(&self) -> Option<f64> {
        Some(self.follower.progress(self.belief()?)?.lateral_error_m)
    }

    fn drive(&mut self, now: Time) -> Proposal {
        let Some(belief) = self.belief().copied() else { return Proposal::abstain(Reason::NoInput) };
        let proposal = self.follower.drive(&belief, self.speed_factor(&belief, now));
        match proposal.reason() {
            Some(Reason::Nominal) => proposal.with_reason(self.tracker.status().1),
            _ => proposal,
        }
    }

    /// Returns the fraction of the cruising speed that the quality of the pose estimate permits, 0 to 1.
    fn speed_factor(&self, belief: &Belief, now: Time) -> f64 {
        let age_s = self.tracker.last_fix_at().map_or(f64::INFINITY, |fix| now.seconds_after(fix));
        let factor: f64 = match self.tracker.status().0 {
            PoseStatus::Tracking => 1.0,
            PoseStatus::Coasting if age_s <= COAST_S => 1.0,
            _ => 0.5,
        };
        let is_vague = belief.sigma_xy_m() > VAGUE_SIGMA.0 || belief.sigma_theta_rad() > VAGUE_SIGMA.1;
        if is_vague { factor.min(0.4) } else { factor }
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some((stamp, belief)) = self.tracker.newest() else { return };
        let (stamp_ns, evidence_ns) = (stamp.0, self.tracker.evidence().0);
        self.sequence += 1;
        // An offset of the whole map is common to all images, so more images do not reduce it.
        let map_variance = |i: usize| if i == 0 || i == 4 { self.map_variance } else { 0.0 };
        let pose = Pose {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            x: belief.pose.x,
            y: belief.pose.y,
            theta: belief.pose.theta,
            covariance: std::array::from_fn(|i| belief.covariance[(i / 3, i % 3)] + map_variance(i)),
            status: self.tracker.status().0.code(),
            reserved: 0,
        };
        // A failed publication does not affect the proposal.
        let _ = outputs.publish(POSE.name, &pose, &[]);
        let Some(progress) = self.follower.progress(belief) else { return };
        let header = PathHeader {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            lateral_error_m: progress.lateral_error_m,
            heading_error_rad: progress.heading_error_rad,
            progress_m: progress.progress_m,
        };
        let mut points = [PathPoint::default(); MAX_CORNERS];
        let corners = self.follower.route().corners();
        for (point, corner) in points.iter_mut().zip(corners) {
            *point = PathPoint { x: corner.x, y: corner.y };
        }
        let _ = outputs.publish(PATH.name, &header, &points[..corners.len().min(MAX_CORNERS)]);
    }
}

/// Turns in place until the pose is found; halts after the last heading of the search.
fn look_around(turn: Option<Twist>) -> Proposal {
    match turn {
        Some(twist) => Proposal::drive(Axes::PLANAR, twist)
            .uncoupled()
            .with_reason(Reason::Searching)
            .with_note(format_args!("pose lost, looking around")),
        None => Proposal::halt(Axes::PLANAR, Reason::Lost)
            .with_note(format_args!("pose lost; no place on the map recognized")),
    }
}
