//! Finds the robot on a map, and follows a planned path to a goal.
//!
//! Ohya, Kosaka & Kak (1998): what an old picture shows corrects the position of its own instant. Differs from \[1\]: every
//! picture is used, and the covariance is corrected with the pose. What finds the robot in a picture is a
//! [`fix::PoseFinder`]: by the edges of a [wire frame](wire_frame), by [azimuths](azimuth) or by the
//! [outline of the floor](floor_outline).

pub mod azimuth;
pub mod belief;
pub mod config;
pub mod dead_reckoning;
pub mod driver;
pub mod finder;
pub mod fix;
pub mod floor_outline;
pub mod health;
pub mod history;
pub mod look_around;
pub mod motion;
pub mod obstacles;
pub mod pursuit;
pub mod route;
pub mod tracker;
pub mod wire_frame;

pub use config::Config;

use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
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
use crate::driver::{Driver, Journey, Polygon};
use crate::finder::Finder;
use crate::fix::Fix;
use crate::floor_outline::FLOOR_PLAN_FILE;
use crate::look_around::LookAround;
use crate::obstacles::Obstacles;
use crate::route::{MAX_CORNERS, Route};
use crate::tracker::{Track, Tracker};

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

/// What stands in the way that the map does not tell of.
pub const OBSTACLES: Slot<ObstaclesHeader> =
    Slot::required("obstacles", "what stands around that is not on the map");

/// A path need not be changed for obstacles that come nearer than planned by less than this, meters.
const REPLAN_M: f64 = 0.03;
/// Odometry older than this (s) is none.
const ODOMETRY_STALE_S: f64 = 0.3;
/// Without a fix for longer than this (s), the robot drives at half its speed.
const COAST_S: f64 = 1.0;
/// With a belief wider than this (m, rad) the robot drives slowly.
const VAGUE: (f64, f64) = (0.2, 0.07);

/// Finds the robot on the map and drives it along its path.
#[derive(Clone, Debug)]
pub struct MapLocalizer {
    tracker: Tracker,
    driver: Driver,
    obstacles: Obstacles,
    /// The obstacles, grown by what the robot must not and what it shall not go nearer.
    near: Vec<Polygon>,
    grown: Vec<Polygon>,
    radius_m: f64,
    map_variance: f64,
    sequence: u64,
    obstacles_told: u64,
}

impl Plugin for MapLocalizer {
    type Config = Config;
    const NAME: &'static str = "map-localizer";
    const SUMMARY: &'static str = "Finds the robot on a map, and follows a planned path to a goal.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), ODOMETRY.info(), GOAL.info()];
    const OUTPUTS: &'static [SlotInfo] = &[POSE.info(), PATH.info(), OBSTACLES.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE, EDGE_MAP_FILE, FLOOR_PLAN_FILE, FLOOR_COLORS_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        config.check()?;
        let finder = Finder::new(&config, setup)?;
        Ok(Self {
            driver: Driver::new(&config, finder.method().walls(), setup.robot.radius_m)?,
            tracker: Tracker::new(&config, finder, &setup.robot),
            obstacles: Obstacles::default(),
            near: Vec::new(),
            grown: Vec::new(),
            radius_m: setup.robot.radius_m,
            map_variance: config.map_sigma_m.powi(2),
            sequence: 0,
            obstacles_told: 0,
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
        self.look(inputs, outputs);
        if let Some(goal) = inputs.latest(&GOAL).filter(|_| inputs.is_fresh(&GOAL))
            && let Some((_, belief)) = self.tracker.newest()
        {
            self.driver.take_goal(goal.header, belief, self.tracker.finder().method().walls());
        }
        let Some(newest) = self.stamp() else { return Proposal::abstain(Reason::NoInput) };
        if before != Some(newest) {
            self.driver.pass(before.map_or(0.0, |before| newest.seconds_after(before)));
            self.publish(outputs);
        }
        let evidence = self.tracker.evidence();
        if now.seconds_after(newest) > ODOMETRY_STALE_S {
            return Proposal::abstain(Reason::StaleInput).with_evidence(evidence);
        }
        let mut proposal = match self.tracker.search() {
            // What the search needs is a picture, whatever it shows.
            Some((search, heading)) => {
                look_around(search, heading).with_evidence(self.tracker.last_picture_at().unwrap_or(evidence))
            }
            None => self.drive(now).with_evidence(evidence),
        };
        proposal.stamp_ns = newest.0;
        proposal
    }

    fn remember(&self, memory: &mut Vec<u8>) {
        if let Some(track) = self.tracker.memory().filter(|_| self.tracker.search().is_none()) {
            // Nothing is a memory too.
            let _ = serde_json::to_writer(memory, &(track, self.driver.memory()));
        }
    }

    fn recall(&mut self, memory: &[u8]) {
        if let Ok((track, journey)) = serde_json::from_slice::<(Track, Journey<'_>)>(memory) {
            self.tracker.recall(&track);
            self.driver.recall(journey);
        }
    }
}

impl MapLocalizer {
    /// The belief at the newest odometry; `None` before any.
    #[must_use]
    pub fn belief(&self) -> Option<&Belief> {
        self.tracker.newest().map(|(_, belief)| belief)
    }

    /// How far the pose can be trusted, and why.
    #[must_use]
    pub fn status(&self) -> (PoseStatus, Reason) {
        self.tracker.status()
    }

    /// What the last picture told; `None` before any.
    #[must_use]
    pub fn last_fix(&self) -> Option<&Fix> {
        self.tracker.last_fix()
    }

    /// What looks at the pictures.
    #[must_use]
    pub fn finder(&self) -> &Finder {
        self.tracker.finder()
    }

    /// The path that is followed.
    #[must_use]
    pub fn route(&self) -> &Route {
        self.driver.route()
    }

    fn stamp(&self) -> Option<Time> {
        self.tracker.newest().map(|(stamp, _)| stamp)
    }

    /// Takes a new picture, and tells the driver what that does to the pose.
    fn look(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) else { return };
        let was_lost = self.tracker.search().is_some();
        let before = self.lateral_error_m();
        self.tracker.look(&frame, inputs.now());
        if was_lost && self.tracker.search().is_none() {
            self.driver.forget_station();
        } else if let (Some(before), Some(after)) = (before, self.lateral_error_m()) {
            self.driver.jump(after - before);
        }
        self.avoid(Time(frame.header.stamp_ns), outputs);
    }

    /// Tells what stands around that is not on the map, and goes round it.
    fn avoid(&mut self, stamp: Time, outputs: &mut Outputs<'_>) {
        let edges = self.tracker.finder().method().unknown_edges();
        if edges.is_empty() && self.obstacles.told().is_empty() {
            return;
        }
        self.obstacles.take(edges);
        if let Some((_, belief)) = self.tracker.newest().filter(|_| self.tracker.search().is_none()) {
            self.obstacles.grow(edges, self.radius_m - REPLAN_M, &mut self.near);
            self.obstacles.grow(edges, self.radius_m, &mut self.grown);
            self.driver.avoid(&self.near, &self.grown, belief);
        }
        let header =
            ObstaclesHeader { stamp_ns: stamp.0, evidence_ns: stamp.0, sequence: self.obstacles_told };
        // Nobody listens, or the bus is full: the path counts all the same.
        if outputs.publish(OBSTACLES.name, &header, self.obstacles.told()).is_ok() {
            self.obstacles_told += 1;
        }
    }

    fn lateral_error_m(&self) -> Option<f64> {
        Some(self.driver.station(self.belief()?)?.lateral_error_m)
    }

    fn drive(&mut self, now: Time) -> Proposal {
        let Some(belief) = self.belief().copied() else { return Proposal::abstain(Reason::NoInput) };
        let proposal = self.driver.drive(&belief, self.share_of_speed(&belief, now));
        match proposal.reason() {
            Some(Reason::Nominal) => proposal.because(self.tracker.status().1),
            _ => proposal,
        }
    }

    /// The share of the cruising speed that the pose is good for.
    fn share_of_speed(&self, belief: &Belief, now: Time) -> f64 {
        let age_s = self.tracker.last_fix_at().map_or(f64::INFINITY, |fix| now.seconds_after(fix));
        let share: f64 = match self.tracker.status().0 {
            PoseStatus::Tracking => 1.0,
            PoseStatus::Coasting if age_s <= COAST_S => 1.0,
            _ => 0.5,
        };
        let is_vague = belief.sigma_xy_m() > VAGUE.0 || belief.sigma_theta_rad() > VAGUE.1;
        if is_vague { share.min(0.4) } else { share }
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some((stamp, belief)) = self.tracker.newest() else { return };
        let (stamp_ns, evidence_ns) = (stamp.0, self.tracker.evidence().0);
        self.sequence += 1;
        // How far the map's edges are off together is in every picture: it does not grow less with more of them.
        let of_map = |i: usize| if i == 0 || i == 4 { self.map_variance } else { 0.0 };
        let pose = Pose {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            x: belief.pose.x,
            y: belief.pose.y,
            theta: belief.pose.theta,
            covariance: std::array::from_fn(|i| belief.covariance[(i / 3, i % 3)] + of_map(i)),
            status: self.tracker.status().0.code(),
            reserved: 0,
        };
        // Nobody listens, or the bus is full: the proposal counts all the same.
        let _ = outputs.publish(POSE.name, &pose, &[]);
        let Some(station) = self.driver.station(belief) else { return };
        let header = PathHeader {
            stamp_ns,
            evidence_ns,
            sequence: self.sequence,
            lateral_error_m: station.lateral_error_m,
            heading_error_rad: station.heading_error_rad,
            progress_m: station.progress_m,
        };
        let mut points = [PathPoint::default(); MAX_CORNERS];
        let corners = self.driver.route().corners();
        for (point, corner) in points.iter_mut().zip(corners) {
            *point = PathPoint { x: corner.x, y: corner.y };
        }
        let _ = outputs.publish(PATH.name, &header, &points[..corners.len().min(MAX_CORNERS)]);
    }
}

/// Turns where the robot stands until the pose is found, or all was looked at.
fn look_around(search: &LookAround, heading: f64) -> Proposal {
    match search.turn(heading) {
        Some(twist) => Proposal::drive(Axes::PLANAR, twist)
            .uncoupled()
            .because(Reason::Searching)
            .with_note(format_args!("pose lost, looking around")),
        None => Proposal::halt(Axes::PLANAR, Reason::Lost)
            .with_note(format_args!("pose lost, and nothing of the map is recognized")),
    }
}
