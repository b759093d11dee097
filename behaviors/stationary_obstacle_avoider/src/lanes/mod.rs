//! The avoider with method `lanes`: evidence from every source in one grid around the robot, and the best lane beside the
//! path.
//!
//! Each picture says where the floor ends in each column, where upright edges stand on it, and by its motion what is flat and
//! what stands; sonars say what is free and what is not. The evidence is added up over pictures and scans, in the frame of the
//! odometry, and fades; that a place was seen as floor is remembered. Walls of the map, or of the corridor, are left out.
//! Where the path is free, other behaviors drive. Where no lane is free, a route around is looked for.

mod arrivals;
mod beam_cone;
mod clusters;
mod covered;
mod crossing;
mod dark_things;
mod decision;
mod drive;
mod evidence_layer;
mod fading;
mod hidden_fan;
mod lane;
mod mode;
mod motion;
mod occupancy;
mod overlay;
mod picture_evidence;
mod planner;
mod refuted_walls;
mod seen_floor;
mod situation;
mod stations;
mod sudden_echo;
mod taken_leg;
mod tries_here;
mod unseen;
mod upright_edges;
mod way_back;
mod way_out;

use nalgebra::Point2;
use yamabico_core::behavior::{Inputs, Outputs, ParameterError, Setup};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{ObstaclesHeader, Proposal, Reason};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::floor_columns::{ColumnRules, FloorColumns};
use yamabico_vision::map::WireFrame;

use crate::config::Config;
use crate::guidance::Guidance;
use crate::sonar_watch::SonarWatch;
use crate::{CAMERA, OBSTACLES, ODOMETRY, SONAR};
use beam_cone::BeamCone;
use clusters::Clusters;
use covered::CoveredGround;
use crossing::Crossing;
use drive::Drive;
use hidden_fan::HiddenFan;
use motion::FloorMotion;
use occupancy::OccupancyGrid;
use picture_evidence::FLOOR_END_M;
use planner::Plan;
use stations::PathAhead;
use upright_edges::UprightEdges;
use way_out::WayFinder;

/// Distance from walls within which evidence is assigned to the wall, m.
const WALL_M: f64 = 0.16;
/// Clearance beyond the robot and its margin that covers errors of the grid, m.
const GRID_ERROR_M: f64 = 0.06;
/// Error beyond the robot's circle that is always kept, m.
const TOUCH_ERROR_M: f64 = 0.015;
/// Error of the walls of a corridor that is seen, m, and of those of a map.
const SEEN_WALL_ERROR_M: f64 = 0.05;
const MAP_WALL_ERROR_M: f64 = 0.03;
/// Distance from the robot up to which walls matter, m: evidence reaches less far, and so do lanes of a path that is not 4 m away.
const NEAR_WALLS_M: f64 = 5.0;
/// Distance around the place where the robot begins that is taken for floor, m: the picture does not show it.
const START_M: f64 = 1.2;
/// Maximum number of occupied cells that are planned with, besides covered ground.
const MAX_CELLS: usize = 2000;
/// Area ahead in which nothing may stand where the color of the floor is learned, m: from, to, and to each side; and the range that no
/// echo ahead may be below.
const LEARN_AREA_M: (f64, f64, f64) = (0.2, 1.2, 0.4);
const LEARN_ECHO_M: f64 = 0.9;
/// Azimuths that part the beams that look ahead from those that look aside, and those from the beams behind, rad.
const AHEAD_RAD: f64 = 0.26;
const ASIDE_RAD: f64 = 1.6;

/// Avoider that drives the best lane beside the path.
#[derive(Clone, Debug)]
pub struct LaneAvoider {
    config: Config,
    clearance_m: f64,
    wall_clearance_m: f64,
    /// Distances at which the robot nearly touches an obstacle, and a wall, m.
    touch_m: f64,
    wall_touch_m: f64,
    size: [u32; 2],
    /// Walls of the building or of the corridor, and those of them around the robot.
    map: WireFrame,
    near_walls: WireFrame,
    columns: FloorColumns,
    motion: Option<FloorMotion>,
    edges: Option<UprightEdges>,
    hidden: HiddenFan,
    covered: CoveredGround,
    /// Pose at the last picture whose upright edges counted, odometry frame.
    edges_from: Option<Pose2>,
    grid: OccupancyGrid,
    gray: GrayImage,
    odometry: OdometryTrack,
    sonar: SonarWatch,
    guidance: Guidance,
    drive: Drive,
    plan: Plan,
    /// Occupied places that are not walls, robot frame, m: covered ground, the nearest, then that many cells.
    occupied: Vec<Point2<f32>>,
    occupied_cells: usize,
    path: PathAhead,
    crossing: Crossing,
    way_finder: WayFinder,
    last_picture: Option<Time>,
    /// Stamp of the first of the newest pictures that show no floor, although nothing is near.
    no_floor_since: Option<Time>,
    last_scan: Option<Time>,
    last_update: Option<Time>,
    /// Why the last pose, and the last picture, could not be used.
    pose_failure: Option<Reason>,
    picture_failure: Option<Reason>,
    clusters: Clusters,
    sequence: u64,
}

impl LaneAvoider {
    /// Creates the avoider of a robot.
    ///
    /// # Errors
    /// The camera is of another kind or sees no floor, or a file cannot be used.
    pub fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        let MountedPinhole { pinhole, mount, .. } = setup.pinhole(&CAMERA)?;
        let columns = FloorColumns::new(&pinhole, &mount, ColumnRules::default()).ok_or_else(|| {
            ParameterError::new("inputs.camera", "sees no floor within 5 m, or has fewer than 4 x 8 pixels")
                .remedy("tilt the camera down, or choose method = \"passages\"")
        })?;
        let map = config.read_map(setup)?;
        let wall_error_m = if config.map.is_some() { MAP_WALL_ERROR_M } else { SEEN_WALL_ERROR_M };
        let half_width_m = setup.robot.radius_m + config.margin_m;
        Ok(Self {
            clearance_m: half_width_m + GRID_ERROR_M,
            wall_clearance_m: half_width_m + wall_error_m,
            touch_m: setup.robot.radius_m + TOUCH_ERROR_M,
            wall_touch_m: setup.robot.radius_m + wall_error_m,
            size: pinhole.intrinsics().size(),
            motion: config.uses_geometry.then(|| FloorMotion::new(&pinhole, mount)).flatten(),
            edges: config.uses_geometry.then(|| UprightEdges::new(&pinhole, &mount)).flatten(),
            hidden: HiddenFan::new(Point2::new(mount.x, mount.y)),
            covered: CoveredGround::default(),
            edges_from: None,
            near_walls: map.clone(),
            map,
            columns,
            grid: OccupancyGrid::default(),
            gray: GrayImage::default(),
            odometry: OdometryTrack::default(),
            sonar: SonarWatch::default(),
            guidance: Guidance::new(config.map.is_none()),
            drive: Drive::default(),
            plan: Plan::default(),
            occupied: Vec::with_capacity(covered::MAX_PLACES + MAX_CELLS),
            occupied_cells: 0,
            path: PathAhead::default(),
            crossing: Crossing::default(),
            way_finder: WayFinder::default(),
            last_picture: None,
            no_floor_since: None,
            last_scan: None,
            last_update: None,
            pose_failure: None,
            picture_failure: None,
            clusters: Clusters::default(),
            sequence: 0,
            config,
        })
    }

    /// Processes the inputs and returns a proposal.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        for odometry in inputs.fresh(&ODOMETRY) {
            self.odometry.push(odometry.header, now);
        }
        match self.guidance.update(inputs, &self.odometry) {
            Err(Reason::MalformedInput) => self.pose_failure = Some(Reason::MalformedInput),
            Ok(Some(_)) => self.pose_failure = None,
            // A corridor that is out of view for a while is passed by odometry.
            Ok(None) | Err(_) => {}
        }
        self.guidance.draw(&mut self.map);
        if let (Some(on_map), Some(newest)) = (self.map_from_odometry(), self.odometry.newest()) {
            let robot = on_map.transform_point(newest.pose.position());
            self.near_walls.take_walls_near(&self.map, robot, NEAR_WALLS_M);
        }
        let picture = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA));
        if let Some(frame) = &picture {
            self.picture_failure = self.look(frame, now).err();
        }
        if self.sonar.update(inputs, &SONAR, self.config.stale_ms * 1e-3) {
            self.add_scan();
        }
        let proposal = self.step(now);
        if let Some(frame) = &picture {
            self.publish(outputs);
            outputs.draw(&CAMERA, frame.header, |overlay| {
                if self.picture_failure.is_none() {
                    overlay::draw_columns(overlay, &self.columns);
                    overlay::draw_edges(overlay, self.edges.as_ref().map_or(&[], UprightEdges::found));
                }
                let robot = self.odometry.newest().map_or(Pose2::IDENTITY, |newest| newest.pose);
                let is_upright =
                    |place: &Point2<f32>| self.grid.is_upright(robot.transform_point(place.cast()));
                overlay::draw_cells(overlay, &self.occupied, is_upright);
                overlay::draw_lanes(overlay, &self.path, &self.plan, self.clearance_m);
            });
        }
        proposal
    }

    /// Appends the state that a restarted avoider continues from.
    pub fn save_state(&self, state: &mut Vec<u8>) {
        // Without saved state the behavior starts anew.
        let _ = serde_json::to_writer(state, &(&self.drive, self.guidance.corridor()));
    }

    /// Continues from a saved state; ignores one that does not fit.
    pub fn restore_state(&mut self, state: &[u8]) {
        if let Ok((drive, corridor)) = serde_json::from_slice(state) {
            self.drive = drive;
            self.guidance.restore(corridor);
        }
    }

    /// Places around the robot that are occupied and no walls, robot frame, m, as of the last call.
    #[must_use]
    pub fn occupied(&self) -> &[Point2<f32>] {
        &self.occupied
    }

    /// Moves the grid to the robot; evidence fades with the time since the last update.
    fn advance(&mut self, at: Time, robot: &Pose2) {
        let is_first = self.last_update.is_none();
        let elapsed_s = self.last_update.map_or(0.0, |last| at.seconds_after(last).max(0.0));
        if self.last_update.is_none_or(|last| at > last) {
            self.last_update = Some(at);
        }
        let (to_robot, columns) = (robot.inverse(), &self.columns);
        let is_in_view = |place: Point2<f64>| {
            let seen = to_robot.transform_point(place);
            seen.x < FLOOR_END_M && columns.is_in_view(seen)
        };
        self.grid.advance(robot.position(), elapsed_s, is_in_view);
        if is_first {
            self.grid.presume_floor(robot.position(), START_M);
        }
    }

    /// Takes in the newest scan once. One that is lost, or without beams, tells nothing.
    fn add_scan(&mut self) {
        if self.sonar.is_silent() {
            return;
        }
        let Some(stamp) = self.sonar.newest().filter(|_| self.sonar.newest() != self.last_scan) else {
            return;
        };
        let Some(robot) = self.odometry.pose_at(stamp) else { return };
        self.last_scan = Some(stamp);
        self.advance(stamp, &robot);
        self.crossing.hear(stamp.as_secs_f64(), self.sonar.nearest_m(-AHEAD_RAD..AHEAD_RAD), robot);
        let on_map = self.map_from_odometry();
        let walls = &self.near_walls;
        // Where the camera looks, and floor does not mirror, pictures tell what comes.
        let (is_matt, to_robot, columns) = (self.is_matt(), robot.inverse(), &self.columns);
        let is_told = |place: Point2<f64>| is_matt && columns.is_in_view(to_robot.transform_point(place));
        let mut came = None;
        for beam in self.sonar.beams() {
            let is_open = |place: Point2<f64>| {
                on_map.is_none_or(|on_map| walls.clearance(on_map.transform_point(place)) > WALL_M)
            };
            let is_new = |place| !is_told(place) && is_open(place) && self.grid.was_floor(place);
            came = BeamCone::echo_on(beam, &robot, is_new).or(came);
            self.grid.add_beam(beam, &robot, is_open);
        }
        let came = came.map(|place| to_robot.transform_point(place));
        self.crossing.hear_step(stamp.as_secs_f64(), &self.path, came);
    }

    /// Transform from the odometry frame to the map frame; `None` if the pose is unknown.
    fn map_from_odometry(&self) -> Option<Pose2> {
        let localized = self.guidance.localized().filter(|localized| localized.is_usable)?;
        Some(localized.pose * localized.odometry.inverse())
    }

    /// True if something stands where the color of the floor is learned, or a sonar sees something near or is silent.
    fn is_occupied_near(&self) -> bool {
        let (from_m, to_m, aside_m) = LEARN_AREA_M;
        let is_near = |place: &Point2<f32>| {
            (from_m..to_m).contains(&f64::from(place.x)) && f64::from(place.y.abs()) < aside_m
        };
        self.occupied.iter().any(is_near)
            || self.sonar.is_silent()
            || self.sonar.nearest_m(-AHEAD_RAD..AHEAD_RAD) < LEARN_ECHO_M
    }

    /// Publishes what stands around the robot, in the robot frame.
    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let (Some(newest), Some(picture)) = (self.odometry.newest(), self.last_picture) else { return };
        self.sequence += 1;
        let header =
            ObstaclesHeader { stamp_ns: newest.stamp.0, evidence_ns: picture.0, sequence: self.sequence };
        // A missing subscriber or a full queue does not affect the proposal.
        let _ = outputs.publish(OBSTACLES.name, &header, self.clusters.group(&self.occupied));
    }
}
