//! Drives around obstacles that are not on the map.
//!
//! ```
//! use yamabico_stationary_obstacle_avoider::safe_passage::{Interval, SafePassage};
//!
//! // The camera covers 0.5 m to each side one meter ahead; an obstacle covers 0.1 m around the middle.
//! let mut passage = SafePassage::default();
//! passage.begin(Interval::new(-0.5, 0.5));
//! passage.block(Interval::new(-0.1, 0.1));
//! let aim = passage.choose(0.02, 0.05).expect("a gap");
//! assert!(aim.deviates && (aim.lateral_m - 0.15).abs() < 1e-9);
//! ```
//!
//! Ohya, Kosaka & Kak (1998): vertical edges that the map does not explain indicate obstacles. The robot turns to a
//! safe passage, drives through it and returns to its path; any sonar echo halts it. Differs from \[1\]: obstacles
//! are located by their foot on the floor and remembered on the map, walls of the map bound every passage, and faint
//! boxes are detected by their sides on the bare floor.

mod assessment;
pub mod config;
pub mod corridor_frame;
pub mod detector;
pub mod floor_steps;
pub mod halt_state_machine;
pub mod horizontal_edges;
mod localization;
mod motion_evidence;
pub mod obstacle_memory;
pub mod obstacle_regions;
pub mod overlay;
pub mod passage_finder;
pub mod recent_frames;
pub mod regions;
pub mod safe_passage;
mod search;
pub mod sonar_watch;
mod steering;
mod step;
pub mod threshold_learning;
pub mod threshold_table;
pub mod vertical_edges;
pub mod view_history;

pub use config::Config;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    Axes, Corridor, FrameHeader, Obstacle, ObstaclesHeader, Odometry, PathHeader, PathPoint, Pose, Proposal,
    RangeScanHeader, Reason, View,
};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_core::parameters::FileKind;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::map::{WIRE_FRAME_FILE, WireFrame};

use crate::corridor_frame::CorridorFrame;
use crate::detector::{Detector, DetectorRules};
use crate::halt_state_machine::{Machine, MotionOrder, Rules, State, VisionResult};
use crate::localization::Localized;
use crate::motion_evidence::MotionEvidence;
use crate::obstacle_memory::ObstacleMemory;
use crate::passage_finder::Clearances;
use crate::recent_frames::RecentFrames;
use crate::safe_passage::{PLANE_M, SafePassage};
use crate::search::Search;
use crate::sonar_watch::SonarWatch;
use crate::threshold_table::{THRESHOLD_FILE, ThresholdTable};
use crate::view_history::ViewHistory;

/// Input: frames of the camera that looks ahead.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames of the area ahead");
/// Input: pose estimate in the map frame.
pub const POSE: Slot<Pose> = Slot::optional("pose", "with a map: pose estimate in the map frame");
/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion since a frame was captured");
/// Input: sonar scans.
pub const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");
/// Input: the planned path, to leave and return to.
pub const PATH: Slot<PathHeader> = Slot::optional("path", "with a map: planned path and progress along it");
/// Input: the corridor around the robot, in place of map, pose and path.
pub const CORRIDOR: Slot<Corridor> =
    Slot::optional("corridor", "without a map: axis and walls of the corridor");
/// Output: confirmed obstacles.
pub const OBSTACLES: Slot<ObstaclesHeader> = Slot::required("obstacles", "obstacles that are not on the map");

/// Time for a person in the way to leave before a search starts, s.
const WAIT_S: f64 = 3.0;

/// Behavior that drives around obstacles that are not on the map.
#[derive(Clone, Debug)]
pub struct StationaryObstacleAvoider {
    config: Config,
    rules: Rules,
    clearances: Clearances,
    detector: Detector,
    table: Option<ThresholdTable>,
    gray: GrayImage,
    frames: RecentFrames,
    odometry: OdometryTrack,
    sonar: SonarWatch,
    localized: Option<Localized>,
    /// True if the robot follows a corridor without a map: `map` and `path` are those of the corridor's frame.
    is_in_corridor: bool,
    corridor: Option<CorridorFrame>,
    path: Vec<PathPoint>,
    path_header: PathHeader,
    known_obstacles: ObstacleMemory,
    views: ViewHistory,
    motion_evidence: Option<MotionEvidence>,
    passage: SafePassage,
    lean_m: f64,
    machine: Machine,
    order: MotionOrder,
    pending: Option<VisionResult>,
    evaluated: Option<Time>,
    failure: Option<Reason>,
    /// True if thresholds were learned where the last frame was captured.
    is_learned: bool,
    /// Reason of the last halt.
    halt_reason: Reason,
    search: Search,
    entered: Time,
    obstacles: Vec<Obstacle>,
    sequence: u64,
}

impl Plugin for StationaryObstacleAvoider {
    type Config = Config;
    const NAME: &'static str = "stationary-obstacle-avoider";
    const SUMMARY: &'static str = "Drives around obstacles that are not on the map.";
    const INPUTS: &'static [SlotInfo] =
        &[CAMERA.info(), POSE.info(), ODOMETRY.info(), SONAR.info(), PATH.info(), CORRIDOR.info()];
    const OUTPUTS: &'static [SlotInfo] = &[OBSTACLES.info()];
    const FILES: &'static [FileKind] = &[WIRE_FRAME_FILE, THRESHOLD_FILE];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        let MountedPinhole { pinhole, mount, period_s, .. } = setup.pinhole(&CAMERA)?;
        let intrinsics = pinhole.intrinsics();
        let half_view = (0.5 * intrinsics.horizontal_fov()).tan();
        let half_width_m = setup.robot.radius_m + config.margin_m;
        if half_width_m >= half_view * PLANE_M {
            let problem = format!(
                "covers {:.2} m to each side one meter ahead, but the robot needs {half_width_m:.2} m: \
                 use a wider lens or reduce `margin_m`",
                half_view * PLANE_M
            );
            return Err(ParameterError::new("inputs.camera", problem));
        }
        let mut rules = DetectorRules::for_size(intrinsics.width, intrinsics.height);
        rules.edges.epsilon = config.epsilon;
        config.check_guidance(setup)?;
        let map = match &config.map {
            Some(file) => WireFrame::read(&setup.folder.join(file))
                .map_err(|error| ParameterError::new("map", error.to_string()))?,
            None => WireFrame::default(),
        };
        let table = match &config.thresholds {
            Some(file) => {
                let table = ThresholdTable::read(&setup.folder.join(file))
                    .map_err(|error| ParameterError::new("thresholds", error))?;
                if (table.width, table.height) != (intrinsics.width, intrinsics.height) {
                    let problem = format!(
                        "were learned with images of {} x {} pixels, but the camera has {} x {}: learn them again",
                        table.width, table.height, intrinsics.width, intrinsics.height
                    );
                    return Err(ParameterError::new("thresholds", problem));
                }
                rules.regions = table.regions as usize;
                Some(table)
            }
            None => None,
        };
        let wait_frames = (WAIT_S / period_s).clamp(0.0, 1000.0);
        let machine_rules = Rules {
            passing_m: config.passing_m,
            looks: Rules::default().looks.max(wait_frames as u32),
            ..Rules::default()
        };
        let machine = Machine::new(&machine_rules);
        Ok(Self {
            rules: machine_rules,
            clearances: Clearances { half_width_m, gap_margin_m: config.gap_margin_m },
            detector: Detector::new(pinhole, mount, map, rules),
            table,
            gray: GrayImage::default(),
            frames: RecentFrames::default(),
            odometry: OdometryTrack::default(),
            sonar: SonarWatch::default(),
            localized: None,
            is_in_corridor: config.map.is_none(),
            corridor: None,
            path: Vec::with_capacity(64),
            path_header: PathHeader::default(),
            known_obstacles: ObstacleMemory::default(),
            views: ViewHistory::new(half_view, mount.pan),
            motion_evidence: config.plane_motion.then(|| MotionEvidence::new(&pinhole, mount)).flatten(),
            passage: SafePassage::default(),
            lean_m: 0.0,
            order: MotionOrder { state: machine.state(), v_zero: true, target_heading: None },
            machine,
            pending: None,
            evaluated: None,
            failure: None,
            is_learned: false,
            halt_reason: Reason::Echo,
            search: Search::default(),
            entered: Time::ZERO,
            obstacles: Vec::with_capacity(32),
            sequence: 0,
            config,
        })
    }

    fn notes(config: &Config, setup: &Setup) -> Vec<String> {
        config.notes(setup)
    }
}

impl Behavior for StationaryObstacleAvoider {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        for odometry in inputs.fresh(&ODOMETRY) {
            self.odometry.push(odometry.header, now);
        }
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.store_frame(&frame, now);
        }
        self.localize(inputs, outputs);
        if self.sonar.update(inputs, &SONAR, self.config.stale_ms * 1e-3) {
            self.step(now);
        }
        let mut proposal = self.proposal(now);
        if let Some(newest) = self.odometry.newest() {
            proposal.stamp_ns = newest.stamp.0;
        }
        proposal
    }

    fn save_state(&self, state: &mut Vec<u8>) {
        // Without saved state the behavior starts anew.
        let _ = serde_json::to_writer(
            state,
            &(&self.machine, &self.known_obstacles, self.lean_m, &self.corridor),
        );
    }

    fn restore_state(&mut self, state: &[u8]) {
        type Saved = (Machine, ObstacleMemory, f64, Option<CorridorFrame>);
        if let Ok((machine, known_obstacles, lean_m, corridor)) = serde_json::from_slice::<Saved>(state) {
            (self.machine, self.known_obstacles, self.lean_m, self.corridor) =
                (machine.after_restart(), known_obstacles, lean_m, corridor);
            self.order = MotionOrder { state: self.machine.state(), ..self.order };
        }
    }
}

impl StationaryObstacleAvoider {
    /// Returns the current state.
    #[must_use]
    pub fn state(&self) -> State {
        self.order.state
    }

    /// Returns the known obstacles, map frame.
    #[must_use]
    pub fn known_obstacles(&self) -> &ObstacleMemory {
        &self.known_obstacles
    }

    fn store_frame(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.frames.newest().is_none_or(|last| stamp > last);
        if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.failure = Some(Reason::MalformedInput);
            return;
        }
        let exposure = match frame.header.exposure {
            exposure if exposure > 0.0 && exposure.is_finite() => exposure,
            _ => 1.0,
        };
        match frame.gray(self.detector.camera().intrinsics().size(), &mut self.gray) {
            Some(image) => self.frames.push(stamp, exposure, image),
            None => self.failure = Some(Reason::MalformedInput),
        }
    }
}
