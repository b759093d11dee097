//! Drives around what stands in the way and is not on the map.
//!
//! Ohya, Kosaka & Kak (1998): vertical edges that the map does not explain are obstacles; the robot turns to a safe passage,
//! drives through it and comes back to its path, and any echo of the sonars halts it. Differs from \[1\]: obstacles are put where
//! their foot is seen and remembered on the map, walls of the map bound every passage, and faint boxes are seen by their sides
//! on the bare floor.

pub mod config;
pub mod detector;
pub mod halt_state_machine;
pub mod kept_pictures;
mod looking;
pub mod obstacle_regions;
pub mod overlay;
pub mod safe_passage;
mod search;
pub mod seen_floor;
pub mod sonar_watch;
mod steering;
pub mod things;
pub mod threshold_learning;
pub mod threshold_table;
pub mod uprights;
pub mod way;

pub use config::Config;

use nalgebra::Point2;
use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    Axes, FrameHeader, Obstacle, ObstaclesHeader, Odometry, PathHeader, PathPoint, Pose, PoseStatus,
    Proposal, RangeScanHeader, Reason, View,
};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_core::parameters::FileKind;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::map::{WIRE_FRAME_FILE, WireFrame};

use crate::detector::{Detector, DetectorRules};
use crate::halt_state_machine::{Look, Machine, Order, Rules, State, Tick};
use crate::kept_pictures::KeptPictures;
use crate::safe_passage::{PLANE_M, SafePassage};
use crate::search::Search;
use crate::seen_floor::SeenFloor;
use crate::sonar_watch::SonarWatch;
use crate::things::Things;
use crate::threshold_table::{THRESHOLD_FILE, ThresholdTable};
use crate::way::Room;

/// The camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "pictures of what is ahead");
/// Where the robot is on the map.
pub const POSE: Slot<Pose> = Slot::required("pose", "where the robot is on the map");
/// Where the wheels say the robot is.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion since a picture was taken");
/// The sonars.
pub const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");
/// The path that it leaves and comes back to.
pub const PATH: Slot<PathHeader> =
    Slot::required("path", "the planned path, and where the robot stands on it");
/// What stands in the way.
pub const OBSTACLES: Slot<ObstaclesHeader> = Slot::required("obstacles", "what stands in the way");

/// A pose that is older (s) is none.
const POSE_STALE_S: f64 = 0.5;
/// An echo so near to a wall of the map is the wall's, meters.
const WALL_ECHO_M: f64 = 0.15;
/// Somebody who stands in the way is waited for so long before the search, seconds.
const WAIT_S: f64 = 3.0;

/// Drives around what stands in the way and is not on the map.
#[derive(Clone, Debug)]
pub struct StationaryObstacleAvoider {
    config: Config,
    rules: Rules,
    room: Room,
    detector: Detector,
    table: Option<ThresholdTable>,
    gray: GrayImage,
    pictures: KeptPictures,
    odometry: OdometryTrack,
    sonar: SonarWatch,
    localized: Option<Localized>,
    path: Vec<PathPoint>,
    station: PathHeader,
    things: Things,
    floor: SeenFloor,
    passage: SafePassage,
    lean_m: f64,
    machine: Machine,
    order: Order,
    pending: Option<Look>,
    looked: Option<Time>,
    trouble: Option<Reason>,
    search: Search,
    entered: Time,
    obstacles: Vec<Obstacle>,
    sequence: u64,
}

/// Where the robot is.
#[derive(Clone, Copy, Debug)]
struct Localized {
    stamp: Time,
    evidence: Time,
    pose: Pose2,
    odometry: Pose2,
    heading_sigma: f64,
    is_usable: bool,
}

impl Plugin for StationaryObstacleAvoider {
    type Config = Config;
    const NAME: &'static str = "stationary-obstacle-avoider";
    const SUMMARY: &'static str = "Drives around what stands in the way and is not on the map.";
    const INPUTS: &'static [SlotInfo] =
        &[CAMERA.info(), POSE.info(), ODOMETRY.info(), SONAR.info(), PATH.info()];
    const OUTPUTS: &'static [SlotInfo] = &[OBSTACLES.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE, THRESHOLD_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        config.check()?;
        let MountedPinhole { pinhole, mount, period_s, .. } = setup.pinhole(&CAMERA)?;
        let intrinsics = pinhole.intrinsics();
        let half_view = (0.5 * intrinsics.horizontal_fov()).tan();
        let half_width_m = setup.robot.radius_m + config.margin_m;
        if half_width_m >= half_view * PLANE_M {
            let problem = format!(
                "sees {:.2} m to either side a meter ahead, and the robot needs {half_width_m:.2} m",
                half_view * PLANE_M
            );
            return Err(BuildError::new("inputs.camera", problem));
        }
        let mut rules = DetectorRules::for_size(intrinsics.width, intrinsics.height);
        rules.edges.epsilon = config.epsilon;
        let map = WireFrame::read(&setup.folder.join(&config.map))
            .map_err(|error| BuildError::new("map", error.to_string()))?;
        let table = match &config.thresholds {
            Some(file) => {
                let table = ThresholdTable::read(&setup.folder.join(file))
                    .map_err(|error| BuildError::new("thresholds", error))?;
                if (table.width, table.height) != (intrinsics.width, intrinsics.height) {
                    let problem = format!(
                        "were learned with pictures of {} x {} pixels, and this camera's are {} x {}: learn them again",
                        table.width, table.height, intrinsics.width, intrinsics.height
                    );
                    return Err(BuildError::new("thresholds", problem));
                }
                rules.regions = table.regions as usize;
                Some(table)
            }
            None => None,
        };
        let pictures_a_wait = (WAIT_S / period_s).clamp(0.0, 1000.0);
        let machine_rules = Rules {
            gate_m: config.gate_m,
            passing_m: config.passing_m,
            looks: Rules::default().looks.max(pictures_a_wait as u32),
            ..Rules::default()
        };
        let machine = Machine::new(&machine_rules);
        Ok(Self {
            rules: machine_rules,
            room: Room { half_width_m, gap_margin_m: config.gap_margin_m },
            detector: Detector::new(pinhole, mount, map, rules),
            table,
            gray: GrayImage::default(),
            pictures: KeptPictures::default(),
            odometry: OdometryTrack::default(),
            sonar: SonarWatch::default(),
            localized: None,
            path: Vec::with_capacity(64),
            station: PathHeader::default(),
            things: Things::default(),
            floor: SeenFloor::new(half_view, mount.pan),
            passage: SafePassage::default(),
            lean_m: 0.0,
            order: Order { state: machine.state(), v_zero: true, target_heading: None },
            machine,
            pending: None,
            looked: None,
            trouble: None,
            search: Search::default(),
            entered: Time::ZERO,
            obstacles: Vec::with_capacity(32),
            sequence: 0,
            config,
        })
    }
}

impl Behavior for StationaryObstacleAvoider {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        for odometry in inputs.fresh(&ODOMETRY) {
            self.odometry.push(odometry.header, now);
        }
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.keep_picture(&frame, now);
        }
        self.take_path(inputs);
        if let Some(pose) = inputs.latest(&POSE).filter(|_| inputs.is_fresh(&POSE)) {
            self.take_pose(pose.header, now, outputs);
        }
        if self.sonar.take(inputs, &SONAR, self.config.stale_ms * 1e-3) {
            self.step(now);
        }
        let mut proposal = self.proposal(now);
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }

    fn remember(&self, memory: &mut Vec<u8>) {
        // Nothing is a memory too.
        let _ = serde_json::to_writer(memory, &(&self.machine, &self.things, self.lean_m));
    }

    fn recall(&mut self, memory: &[u8]) {
        if let Ok((machine, things, lean_m)) = serde_json::from_slice::<(Machine, Things, f64)>(memory) {
            (self.machine, self.things, self.lean_m) = (machine.come_back(), things, lean_m);
            self.order = Order { state: self.machine.state(), ..self.order };
        }
    }
}

impl StationaryObstacleAvoider {
    /// What the robot is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.order.state
    }

    /// What stands in the way, on the map.
    #[must_use]
    pub fn things(&self) -> &Things {
        &self.things
    }

    /// What looks at the pictures.
    #[must_use]
    pub fn detector(&self) -> &Detector {
        &self.detector
    }

    /// The robot on the map now, by its last pose and the odometry since.
    fn robot(&self) -> Option<Pose2> {
        let localized = self.localized?;
        let newest = self.odometry.newest()?;
        Some(localized.pose * localized.odometry.relative(&newest.pose))
    }

    fn keep_picture(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.pictures.newest().is_none_or(|last| stamp > last);
        if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.trouble = Some(Reason::MalformedInput);
            return;
        }
        let exposure = match frame.header.exposure {
            exposure if exposure > 0.0 && exposure.is_finite() => exposure,
            _ => 1.0,
        };
        match frame.gray(self.detector.camera().intrinsics().size(), &mut self.gray) {
            Some(image) => self.pictures.keep(stamp, exposure, image),
            None => self.trouble = Some(Reason::MalformedInput),
        }
    }

    fn take_path(&mut self, inputs: &Inputs<'_>) {
        let Some(path) = inputs.latest(&PATH).filter(|_| inputs.is_fresh(&PATH)) else { return };
        let numbers = [path.header.lateral_error_m, path.header.heading_error_rad, path.header.progress_m];
        if numbers.iter().all(|x| x.is_finite()) {
            self.station = *path.header;
            self.path.clear();
            self.path.extend(path.items.iter().filter(|p| p.x.is_finite() && p.y.is_finite()).take(64));
        }
    }

    /// Takes a pose; where it rests on a picture that was not looked at yet, looks at it.
    fn take_pose(&mut self, pose: &Pose, now: Time, outputs: &mut Outputs<'_>) {
        let (stamp, evidence) = (Time(pose.stamp_ns), Time(pose.evidence_ns));
        let on_map = Pose2::new(pose.x, pose.y, pose.theta);
        let heading_sigma = pose.covariance[8].sqrt();
        let is_old = self.localized.is_some_and(|last| stamp < last.stamp);
        let (Some(odometry), false) = (self.odometry.pose_at(stamp), is_old) else { return };
        if !on_map.is_finite() || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.trouble = Some(Reason::MalformedInput);
            return;
        }
        let is_new = self.localized.is_none_or(|last| evidence > last.evidence);
        let is_usable = matches!(
            pose.status(),
            Some(PoseStatus::Tracking | PoseStatus::Coasting | PoseStatus::Inconsistent)
        );
        let localized = Localized { stamp, evidence, pose: on_map, odometry, heading_sigma, is_usable };
        self.localized = Some(localized);
        if is_new && is_usable && self.pictures.of(evidence).is_some() {
            self.look(&localized, now);
            self.publish(now, outputs);
        }
    }

    fn step(&mut self, now: Time) {
        self.hear_echoes(now);
        self.leave_blind_direction(now);
        let robot = self.robot();
        self.things.expire(now, robot.map(|robot| robot.position()));
        let is_current = self.localized.is_some_and(|localized| {
            localized.is_usable && now.seconds_after(localized.stamp) <= POSE_STALE_S
        });
        let speed_mps = self.odometry.newest().map_or(0.0, |newest| newest.twist.speed());
        let tick = Tick {
            now_s: now.as_secs_f64(),
            sonar_m: self.sonar.ranges_m(),
            speed_mps,
            heading: robot.map_or(f64::NAN, |robot| robot.theta),
            lateral_m: self.station.lateral_error_m,
            path_heading_error: self.station.heading_error_rad,
            progress_m: self.station.progress_m,
            pose_ok: is_current && robot.is_some(),
            vision: self.pending.take(),
        };
        let before = self.order.state;
        (self.machine, self.order) = self.machine.step(&tick, &self.rules);
        let along = robot.map(|robot| robot.theta - self.station.heading_error_rad);
        if self.order.state == State::Relook && self.search.is_due() {
            (self.machine, self.order) = self.machine.look_around();
        }
        if self.order.state != before {
            self.entered = now;
            self.search = self.search.after(self.order.state, robot, along);
            if matches!(self.order.state, State::Follow | State::Rejoin | State::Search) {
                self.lean_m = 0.0;
            }
        }
        if self.search.is_in_vain() {
            (self.machine, self.order) = self.machine.give_up();
            (self.entered, self.search) = (now, Search::default());
        }
        if self.order.state == State::Blocked && now.seconds_after(self.entered) > self.config.retry_s {
            self.things.forget_ahead(robot);
            (self.machine, self.search) = (self.machine.look_around().0, Search::default());
        }
    }

    /// What the sonars hear stands in the way, unless it is a wall of the map.
    fn hear_echoes(&mut self, now: Time) {
        let Some(robot) = self.robot() else { return };
        for beam in self.sonar.beams() {
            let Some(range_m) = beam.echo_m().filter(|range| (0.0..self.config.gate_m).contains(range))
            else {
                continue;
            };
            let (sin, cos) = beam.azimuth_rad.sin_cos();
            let at = Point2::new(beam.x_m + range_m * cos, beam.y_m + range_m * sin);
            let on_map = robot.transform_point(at);
            let is_sound = on_map.x.is_finite() && on_map.y.is_finite();
            if is_sound && self.detector.map().clearance(on_map) > WALL_ECHO_M {
                self.things.hear(on_map, 0.1, now);
            }
        }
    }

    fn publish(&mut self, now: Time, outputs: &mut Outputs<'_>) {
        let (Some(robot), Some(newest), Some(looked)) = (self.robot(), self.odometry.newest(), self.looked)
        else {
            return;
        };
        self.obstacles.clear();
        for thing in self.things.confirmed() {
            let at = robot.inverse().transform_point(thing.at);
            let variance = (0.1 * at.coords.norm()).powi(2);
            self.obstacles.push(Obstacle {
                x: at.x,
                y: at.y,
                radius_m: thing.radius_m,
                covariance: [variance, 0.0, 0.0, variance],
                confidence: (1.0 - now.seconds_after(thing.seen) / things::SEEN_S).clamp(0.0, 1.0),
            });
        }
        self.sequence += 1;
        let header =
            ObstaclesHeader { stamp_ns: newest.stamp.0, evidence_ns: looked.0, sequence: self.sequence };
        // Nobody listens, or the bus is full: the proposal counts all the same.
        let _ = outputs.publish(OBSTACLES.name, &header, &self.obstacles);
    }
}
