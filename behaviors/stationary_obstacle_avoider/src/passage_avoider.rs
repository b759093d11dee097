//! The avoider with method `passages`: halts for echoes, looks, turns to a passage and drives through it.

use yamabico_core::behavior::{Inputs, Outputs, ParameterError, Setup};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, Obstacle, Proposal, Reason, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::overlay::Overlay;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;

use crate::config::Config;
use crate::corridor_frame::CorridorFrame;
use crate::detector::{Detector, DetectorRules};
use crate::guidance::Guidance;
use crate::halt_state_machine::{Machine, MotionOrder, Rules, State, VisionResult};
use crate::motion_evidence::MotionEvidence;
use crate::obstacle_memory::ObstacleMemory;
use crate::passage_finder::Clearances;
use crate::recent_frames::RecentFrames;
use crate::safe_passage::{PLANE_M, SafePassage};
use crate::search::Search;
use crate::sonar_watch::SonarWatch;
use crate::threshold_table::ThresholdTable;
use crate::view_history::ViewHistory;
use crate::{CAMERA, ODOMETRY, SONAR, overlay};

/// Time for a person in the way to leave before a search starts, s.
const WAIT_S: f64 = 3.0;

/// Avoider that halts for echoes, looks, and turns to a passage.
#[derive(Clone, Debug)]
pub struct PassageAvoider {
    pub(crate) config: Config,
    pub(crate) rules: Rules,
    pub(crate) clearances: Clearances,
    pub(crate) detector: Detector,
    pub(crate) table: Option<ThresholdTable>,
    gray: GrayImage,
    pub(crate) frames: RecentFrames,
    pub(crate) odometry: OdometryTrack,
    pub(crate) sonar: SonarWatch,
    pub(crate) guidance: Guidance,
    pub(crate) known_obstacles: ObstacleMemory,
    pub(crate) views: ViewHistory,
    pub(crate) motion_evidence: Option<MotionEvidence>,
    pub(crate) passage: SafePassage,
    pub(crate) lean_m: f64,
    pub(crate) machine: Machine,
    pub(crate) order: MotionOrder,
    pub(crate) pending: Option<VisionResult>,
    pub(crate) evaluated: Option<Time>,
    pub(crate) failure: Option<Reason>,
    /// True if thresholds were learned where the last frame was captured.
    pub(crate) is_learned: bool,
    /// Reason of the last halt.
    pub(crate) halt_reason: Reason,
    pub(crate) search: Search,
    pub(crate) entered: Time,
    pub(crate) obstacles: Vec<Obstacle>,
    pub(crate) sequence: u64,
}

impl PassageAvoider {
    /// Creates the avoider of a robot.
    ///
    /// # Errors
    /// The camera is too narrow or of another kind, or a file cannot be used.
    pub fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
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
        let map = config.read_map(setup)?;
        let table = config.read_thresholds(setup, [intrinsics.width, intrinsics.height])?;
        if let Some(table) = &table {
            rules.regions = table.regions as usize;
        }
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
            guidance: Guidance::new(config.map.is_none()),
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

    /// Processes the inputs and returns a proposal.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
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

    /// Appends the state that a restarted avoider continues from.
    pub fn save_state(&self, state: &mut Vec<u8>) {
        // Without saved state the behavior starts anew.
        let _ = serde_json::to_writer(
            state,
            &(&self.machine, &self.known_obstacles, self.lean_m, &self.guidance.corridor()),
        );
    }

    /// Continues from a saved state; ignores one that does not fit.
    pub fn restore_state(&mut self, state: &[u8]) {
        type Saved = (Machine, ObstacleMemory, f64, Option<CorridorFrame>);
        if let Ok((machine, known_obstacles, lean_m, corridor)) = serde_json::from_slice::<Saved>(state) {
            (self.machine, self.known_obstacles, self.lean_m) =
                (machine.after_restart(), known_obstacles, lean_m);
            self.guidance.restore(corridor);
            self.order = MotionOrder { state: self.machine.state(), ..self.order };
        }
    }

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

    /// Returns the current pose in the map frame.
    pub(crate) fn robot(&self) -> Option<Pose2> {
        self.guidance.robot(&self.odometry)
    }

    /// Takes in pose and path; if the pose was estimated from a frame that was not evaluated yet, evaluates that frame.
    fn localize(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let localized = match self.guidance.update(inputs, &self.odometry) {
            Ok(Some(localized)) => localized,
            Ok(None) => return,
            Err(reason) => {
                self.failure = Some(reason);
                return;
            }
        };
        self.guidance.draw(self.detector.map_mut());
        let is_due = localized.is_new && localized.is_usable;
        if is_due && self.frames.taken_at(localized.evidence).is_some() {
            self.evaluate(&localized, inputs.now());
            self.publish(inputs.now(), outputs);
            // The frame lies some calls back: the pose was estimated from it since.
            let frame = FrameHeader { stamp_ns: localized.evidence.0, ..FrameHeader::default() };
            outputs.draw(&CAMERA, &frame, |overlay| self.draw(overlay));
        }
    }

    /// Draws what was found in the frame that was evaluated last.
    fn draw(&self, overlay: &mut Overlay) {
        if self.failure.is_none() {
            overlay::draw_evidence(overlay, &self.detector);
        }
        if let Some(robot) = self.robot() {
            let heading = self.odometry.newest().map_or(0.0, |newest| newest.pose.theta);
            let aim_rad = self.order.target_heading.map(|target| angle_difference(target, heading));
            overlay::draw_known(overlay, self.known_obstacles.all().iter(), &robot, aim_rad);
        }
    }

    fn store_frame(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        if !stamp.is_next(self.frames.newest(), now) {
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
