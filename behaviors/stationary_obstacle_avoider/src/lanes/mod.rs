//! The avoider with method `lanes`: evidence from every source in one grid around the robot, and the best lane beside the
//! path.
//!
//! Each picture says where the floor ends in each column; sonars say what is free and what is not. The evidence is added up
//! over pictures and scans, in the frame of the odometry, and fades. Walls of the map, or of the corridor, are left out.
//! Where the path is free, other behaviors drive.

pub mod occupancy;
pub mod planner;

mod drive;

use nalgebra::{Point2, Vector2};
use yamabico_core::behavior::{Inputs, Outputs, ParameterError, Setup};
use yamabico_core::geometry::{Pose2, Twist, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    Axes, Beam, FrameHeader, Kind, Obstacle, ObstaclesHeader, Proposal, Reason, View,
};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::floor_appearance::Picture;
use yamabico_vision::floor_columns::{ColumnRules, FloorColumns};
use yamabico_vision::map::WireFrame;

use crate::config::Config;
use crate::guidance::Guidance;
use crate::passage_finder::point_on_path;
use crate::sonar_watch::SonarWatch;
use crate::{CAMERA, OBSTACLES, ODOMETRY, SONAR};
use drive::{Drive, Situation};
use occupancy::OccupancyGrid;
use planner::{Plan, STATIONS, Scene, Station, station_m};

/// Log odds of floor, and of the place where it ends, in one picture.
const FLOOR: f32 = -0.7;
const FLOOR_END: f32 = 1.3;
/// Log odds of an end of the floor where a sonar sees farther: a mirror image, or something below the beam.
const FLOOR_END_IN_BEAM: f32 = 0.2;
/// Distances up to which floor and its end count, m.
const FLOOR_M: f64 = 2.6;
const FLOOR_END_M: f64 = 2.4;
/// Distance from walls within which evidence is assigned to the wall, m.
const WALL_M: f64 = 0.16;
/// Clearance beyond the robot and its margin that covers errors of the grid, m.
const GRID_ERROR_M: f64 = 0.06;
/// Area around the robot whose obstacles matter for planning, m: behind, ahead, and to each side.
const AROUND_M: (f64, f64, f64) = (-0.5, 2.7, 2.0);
/// Maximum number of occupied cells that are planned with; nearer ones first come first.
const MAX_CELLS: usize = 2000;
/// Area ahead in which nothing may stand where the color of the floor is learned, m: along, and to each side.
const LEARN_AREA_M: (f64, f64) = (1.2, 0.4);
/// Distance from the end of the path at which the robot has arrived, m.
const ARRIVED_M: f64 = 0.35;
/// Age of the newest picture above which the speed is limited, s.
const PICTURE_STALE_S: f64 = 1.0;

/// Avoider that drives the best lane beside the path.
#[derive(Clone, Debug)]
pub struct LaneAvoider {
    config: Config,
    clearance_m: f64,
    wall_clearance_m: f64,
    size: [u32; 2],
    map: WireFrame,
    columns: FloorColumns,
    grid: OccupancyGrid,
    gray: GrayImage,
    odometry: OdometryTrack,
    sonar: SonarWatch,
    guidance: Guidance,
    drive: Drive,
    plan: Plan,
    /// Occupied places that are not walls, robot frame, m.
    occupied: Vec<Point2<f32>>,
    stations: [Station; STATIONS],
    last_picture: Option<Time>,
    last_scan: Option<Time>,
    last_update: Option<Time>,
    failure: Option<Reason>,
    obstacles: Vec<Obstacle>,
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
            ParameterError::new("inputs.camera", "sees no floor within 5 m")
                .remedy("tilt the camera down, or choose method = \"passages\"")
        })?;
        let map = config.read_map(setup)?;
        let half_width_m = setup.robot.radius_m + config.margin_m;
        let station = Station { place: Point2::origin(), left: Vector2::y() };
        Ok(Self {
            clearance_m: half_width_m + GRID_ERROR_M,
            wall_clearance_m: half_width_m,
            size: pinhole.intrinsics().size(),
            map,
            columns,
            grid: OccupancyGrid::default(),
            gray: GrayImage::default(),
            odometry: OdometryTrack::default(),
            sonar: SonarWatch::default(),
            guidance: Guidance::new(config.map.is_none()),
            drive: Drive::default(),
            plan: Plan::default(),
            occupied: Vec::with_capacity(MAX_CELLS),
            stations: [station; STATIONS],
            last_picture: None,
            last_scan: None,
            last_update: None,
            failure: None,
            obstacles: Vec::with_capacity(MAX_OBSTACLES),
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
            Ok(_) => self.guidance.draw(&mut self.map),
            Err(reason) => self.failure = Some(reason),
        }
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.failure = self.look(&frame, now).err();
            self.publish(outputs);
        }
        if self.sonar.update(inputs, &SONAR, self.config.stale_ms * 1e-3) {
            self.add_scan();
        }
        self.step(now)
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

    /// Lane that the path leads along, and the best one, as of the last call.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Places around the robot that are occupied and no walls, robot frame, m, as of the last call.
    #[must_use]
    pub fn occupied(&self) -> &[Point2<f32>] {
        &self.occupied
    }

    /// Moves the grid to the robot; evidence fades with the time since the last update.
    fn advance(&mut self, at: Time, robot: &Pose2) {
        let elapsed_s = self.last_update.map_or(0.0, |last| at.seconds_after(last).max(0.0));
        if self.last_update.is_none_or(|last| at > last) {
            self.last_update = Some(at);
        }
        self.grid.advance(robot.position(), elapsed_s);
    }

    /// Takes in a picture.
    fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) -> Result<(), Reason> {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.last_picture.is_none_or(|last| stamp > last);
        if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            return Err(Reason::MalformedInput);
        }
        let robot = self.odometry.pose_at(stamp).ok_or(Reason::NoInput)?;
        let learns = !self.is_occupied_near();
        let color = frame.rgb(self.size).map(Picture::Color);
        let picture = color.or_else(|| frame.gray(self.size, &mut self.gray).map(Picture::Gray));
        if !self.columns.look(picture.ok_or(Reason::MalformedInput)?, learns) {
            return Err(Reason::MalformedInput);
        }
        self.last_picture = Some(stamp);
        self.advance(stamp, &robot);
        let to_odometry = |place: Point2<f64>| robot.transform_point(place);
        let (columns, beams) = (&self.columns, self.sonar.beams());
        let is_in_beam = |place: &Point2<f64>| {
            beams.iter().any(|beam| {
                let off = place - Point2::new(beam.x_m, beam.y_m);
                let is_inside = angle_between(off.y.atan2(off.x), beam.azimuth_rad) < 0.35 * beam.cone_rad;
                is_inside && off.norm() + 0.15 < beam.echo_m().unwrap_or(f64::INFINITY)
            })
        };
        let floor = columns.free().filter(|place| place.x < FLOOR_M);
        self.grid.add(floor.map(to_odometry), FLOOR);
        let ends = || columns.ends().filter(|place| place.x < FLOOR_END_M);
        // An obstacle is deeper than its foot.
        let deep = |place: Point2<f64>| [place, Point2::new(place.x + occupancy::CELL_M, place.y)];
        let seen = ends().filter(|place| !is_in_beam(place)).flat_map(deep).map(to_odometry);
        self.grid.add(seen, FLOOR_END);
        let doubtful = ends().filter(is_in_beam).map(to_odometry);
        self.grid.add(doubtful, FLOOR_END_IN_BEAM);
        Ok(())
    }

    /// Takes in the newest scan once.
    fn add_scan(&mut self) {
        let Some(stamp) = self.sonar.newest().filter(|_| self.sonar.newest() != self.last_scan) else {
            return;
        };
        let Some(robot) = self.odometry.pose_at(stamp) else { return };
        self.last_scan = Some(stamp);
        self.advance(stamp, &robot);
        let on_map = self.map_from_odometry();
        let map = &self.map;
        for beam in self.sonar.beams() {
            let is_open = |place: Point2<f64>| {
                on_map.is_none_or(|on_map| map.clearance(on_map.transform_point(place)) > WALL_M)
            };
            self.grid.add_beam(beam, &robot, is_open);
        }
    }

    /// Transform from the odometry frame to the map frame; `None` if the pose is unknown.
    fn map_from_odometry(&self) -> Option<Pose2> {
        let localized = self.guidance.localized().filter(|localized| localized.is_usable)?;
        Some(localized.pose * localized.odometry.inverse())
    }

    /// True if something stands where the color of the floor is learned, or a sonar sees something near.
    fn is_occupied_near(&self) -> bool {
        let (along_m, aside_m) = LEARN_AREA_M;
        let is_near = |place: &Point2<f32>| {
            (0.2..along_m).contains(&f64::from(place.x)) && f64::from(place.y.abs()) < aside_m
        };
        self.occupied.iter().any(is_near) || self.echo_ahead_m() < along_m - 0.3
    }

    /// Range of the nearest echo of a beam that looks ahead, m from its sensor; infinite without one.
    fn echo_ahead_m(&self) -> f64 {
        let ahead = self.sonar.beams().iter().filter(|beam| beam.azimuth_rad.abs() < 0.26);
        ahead.filter_map(Beam::echo_m).fold(f64::INFINITY, f64::min)
    }

    /// Range of the nearest echo of a beam that looks to the left (`side` 1) or right (-1), m from its sensor.
    fn echo_aside_m(&self, side: f64) -> f64 {
        let aside = self.sonar.beams().iter().filter(|beam| (0.26..1.6).contains(&(side * beam.azimuth_rad)));
        aside.filter_map(Beam::echo_m).fold(f64::INFINITY, f64::min)
    }

    /// Plans, and returns the proposal.
    fn step(&mut self, now: Time) -> Proposal {
        let Some(newest) = self.odometry.newest().copied() else {
            return Proposal::abstain(Reason::NoInput);
        };
        let on_map = self.map_from_odometry();
        self.gather_occupied(&newest.pose, on_map.as_ref());
        let robot = on_map.map(|on_map| on_map * newest.pose);
        let lateral_m = self.place_stations(robot.as_ref());
        let map = &self.map;
        let wall_m = |place: Point2<f64>| {
            robot.map_or(f64::INFINITY, |robot| map.clearance(robot.transform_point(place)))
        };
        let scene = Scene {
            stations: &self.stations,
            lateral_m,
            obstacles: &self.occupied,
            wall_m: &wall_m,
            clearance_m: self.clearance_m,
            wall_clearance_m: self.wall_clearance_m,
        };
        self.plan = scene.plan(self.drive.lane_m());
        let aim = self.stations[drive::AIM_STATION].beside(self.plan.best.offset_m);
        let situation = Situation {
            now_s: now.as_secs_f64(),
            plan: self.plan,
            aim,
            odometry: newest.pose,
            path_heading: -self.stations[0].left.x.atan2(self.stations[0].left.y),
            echo_ahead_m: self.echo_ahead_m(),
            echo_left_m: self.echo_aside_m(1.0),
            echo_right_m: self.echo_aside_m(-1.0),
            is_sonar_silent: self.sonar.beams().is_empty(),
            gate_m: self.config.gate_m,
            clearance_m: self.clearance_m,
            speed_mps: self.config.speed_mps,
            max_turn_radps: self.config.max_turn_radps,
            is_arrived: self.is_arrived(),
            room_m: [1.0, -1.0].map(|side| room_aside(&scene, side)),
        };
        let proposal = match self.drive.step(&situation) {
            proposal if proposal.kind() == Some(Kind::Abstain) => self.follow(now),
            proposal => proposal,
        };
        let evidence =
            self.last_picture.map_or(now, |picture| picture.max(self.last_scan.unwrap_or(picture)));
        let mut proposal = proposal.with_evidence(evidence.min(now));
        proposal.stamp_ns = newest.stamp.0;
        proposal
    }

    /// True if the path ends here.
    fn is_arrived(&self) -> bool {
        let corners = self.guidance.path().windows(2);
        let length_m: f64 = corners.map(|pair| (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y)).sum();
        length_m > 0.0 && length_m - self.guidance.path_header().progress_m < ARRIVED_M
    }

    /// Abstains, or limits the speed if vision gives no result.
    fn follow(&self, now: Time) -> Proposal {
        let is_stale = self.last_picture.is_none_or(|stamp| now.seconds_after(stamp) > PICTURE_STALE_S);
        match self.failure.or(is_stale.then_some(Reason::StaleInput)) {
            Some(reason) => {
                let limits = Twist { angular: 0.0, ..Twist::planar(self.config.blind_speed_mps, 0.0) };
                Proposal::limit(Axes::LINEAR, limits, reason)
                    .with_note(format_args!("no frame was evaluated: {reason}"))
            }
            None => Proposal::abstain(Reason::Clear),
        }
    }

    /// Gathers the occupied cells around the robot that are not walls.
    fn gather_occupied(&mut self, robot: &Pose2, on_map: Option<&Pose2>) {
        let to_robot = robot.inverse();
        let (map, (behind_m, ahead_m, aside_m)) = (&self.map, AROUND_M);
        self.occupied.clear();
        for cell in self.grid.occupied() {
            let place = to_robot.transform_point(cell);
            let is_around = (behind_m..ahead_m).contains(&place.x) && place.y.abs() < aside_m;
            let is_open = || on_map.is_none_or(|on_map| map.clearance(on_map.transform_point(cell)) > WALL_M);
            if is_around && self.occupied.len() < MAX_CELLS && is_open() {
                self.occupied.push(place.cast());
            }
        }
    }

    /// Places the stations along the path, or straight ahead if the pose or the path is unknown. Returns the distance of
    /// the robot from the path, m, positive left.
    fn place_stations(&mut self, robot: Option<&Pose2>) -> f64 {
        let path = self.guidance.path();
        let progress_m = self.guidance.path_header().progress_m;
        let start = robot.filter(|_| path.len() > 1).and_then(|robot| {
            let (place, heading) = point_on_path(path, progress_m, 0.0)?;
            let off = robot.position() - place;
            let along_m = off.x * heading.cos() + off.y * heading.sin();
            let lateral_m = off.y * heading.cos() - off.x * heading.sin();
            Some((robot.inverse(), progress_m + along_m, lateral_m))
        });
        for (i, station) in self.stations.iter_mut().enumerate() {
            let on_path = start.and_then(|(to_robot, from_m, _)| {
                let (place, heading) = point_on_path(path, from_m, station_m(i))?;
                let left = Vector2::new(-heading.sin(), heading.cos());
                Some(Station { place: to_robot.transform_point(place), left: to_robot.rotate_vector(left) })
            });
            *station =
                on_path.unwrap_or(Station { place: Point2::new(station_m(i), 0.0), left: Vector2::y() });
        }
        start.map_or(0.0, |(.., lateral_m)| lateral_m)
    }

    /// Publishes what stands around the robot, in the robot frame.
    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let (Some(newest), Some(picture)) = (self.odometry.newest(), self.last_picture) else { return };
        self.obstacles.clear();
        for place in self.occupied.iter().map(|place| place.cast::<f64>()) {
            let has_room = self.obstacles.len() < MAX_OBSTACLES;
            match self.obstacles.iter_mut().find(|obstacle| {
                (Point2::new(obstacle.x, obstacle.y) - place).norm()
                    < obstacle.radius_m + 2.0 * occupancy::CELL_M
            }) {
                // The circle grows to hold the cell.
                Some(obstacle) => {
                    let off = place - Point2::new(obstacle.x, obstacle.y);
                    let beyond_m = 0.5 * (off.norm() + 0.5 * occupancy::CELL_M - obstacle.radius_m);
                    if beyond_m > 0.0 {
                        let step = off.normalize() * beyond_m;
                        (obstacle.x, obstacle.y) = (obstacle.x + step.x, obstacle.y + step.y);
                        obstacle.radius_m += beyond_m;
                    }
                }
                None if has_room => {
                    let variance = occupancy::CELL_M * occupancy::CELL_M;
                    self.obstacles.push(Obstacle {
                        x: place.x,
                        y: place.y,
                        radius_m: 0.5 * occupancy::CELL_M,
                        covariance: [variance, 0.0, 0.0, variance],
                        confidence: 0.9,
                    });
                }
                None => {}
            }
        }
        self.sequence += 1;
        let header =
            ObstaclesHeader { stamp_ns: newest.stamp.0, evidence_ns: picture.0, sequence: self.sequence };
        // A missing subscriber or a full queue does not affect the proposal.
        let _ = outputs.publish(OBSTACLES.name, &header, &self.obstacles);
    }
}

/// Maximum number of obstacles that are published.
const MAX_OBSTACLES: usize = 32;

/// Absolute difference of two angles, rad.
fn angle_between(a: f64, b: f64) -> f64 {
    angle_difference(a, b).abs()
}

/// Room to the left (`side` 1) or right (-1) of the path in the next meter, m, at most 1: where the robot could stand.
fn room_aside(scene: &Scene<'_>, side: f64) -> f64 {
    const STEPS: usize = 10;
    const AHEAD: [usize; 3] = [4, 8, 12];
    let is_free = |place: Point2<f64>| {
        let at = place.cast::<f32>();
        (scene.wall_m)(place) > scene.wall_clearance_m
            && scene.obstacles.iter().all(|cell| (cell - at).norm() > scene.clearance_m as f32)
    };
    let beside = |step: usize| side * (step + 1) as f64 / STEPS as f64;
    let places = (0..STEPS).flat_map(|step| AHEAD.map(|i| scene.stations[i].beside(beside(step))));
    places.filter(|&place| is_free(place)).count() as f64 / (STEPS * AHEAD.len()) as f64
}
