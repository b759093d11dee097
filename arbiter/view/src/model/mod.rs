//! The state of a robot as people look at it, from the messages of a run.
//!
//! [`Model`] takes in messages in the order of the run, whether they come from a running robot or from a recording, and
//! describes the robot's state: [`Model::snapshot`] changes all the time, [`Model::setup`] rarely, [`Model::strips`] and
//! [`Model::events`] only grow. The browser page and the terminal show these.

mod events;
mod latency;
mod overlays;
mod pictures;
mod plugins;
mod rate;
mod read;
mod scene;
mod setup;
mod strips;

use serde::Serialize;
use yamabico_arbiter::decide::{
    AxisExplanation, DecisionMessage, ExplainContext, Explanation, ProposalTerms, explain,
};
use yamabico_core::message::{
    Command, DecisionHeader, FrameHeader, Message, MessageType, Mode, Outcome, RetuneHeader,
    RobotManifestHeader,
};
use yamabico_core::time::Time;
use yamabico_runtime::execution::RobotManifest;
use yamabico_runtime::record::Tap;

pub(crate) use events::makes_events;
pub use events::{Event, EventKind, EventLog, MAX_EVENTS};
pub use latency::{LatencySummary, STAGES, StageLatency};
pub use overlays::Overlays;
pub use pictures::{Picture, PictureView, Pictures};
pub use plugins::{BehaviorView, CallFigures, Motion, SensorView};
pub(crate) use read::header;
pub use scene::{ObstacleView, PoseView, ScanView, SceneView};
pub(crate) use setup::map_files;
#[cfg(feature = "page")]
pub(crate) use setup::read_maps;
pub use setup::{BehaviorParameters, Setup};
pub use strips::{STRIP_S, Sample, Strips};

use latency::Latency;
use plugins::Plugins;
use scene::Scene;

/// Message type of overlays.
pub(crate) const OVERLAY: &str = "yamabico.OverlayHeader.v1";

/// State of a robot at one instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Snapshot {
    /// Time since the start of the run, s.
    pub time_s: f64,
    /// Mode of the arbiter; empty before the first decision.
    pub mode: &'static str,
    /// Mode and its cause in the words of `yamabico why`.
    pub headline: String,
    /// Age of the newest decision, s.
    pub decision_age_s: Option<f64>,
    /// Axes of the drive, from the proposed to the commanded speed.
    pub axes: Vec<AxisExplanation>,
    /// Behaviors in the order of the task.
    pub behaviors: Vec<BehaviorView>,
    /// Sensors.
    pub sensors: Vec<SensorView>,
    /// Latency of the commands by stage; `None` before the first command of a behavior.
    pub latency: Option<LatencySummary>,
    /// Top view.
    pub scene: SceneView,
    /// Newest pictures.
    pub pictures: Vec<PictureView>,
}

/// The state of a robot, from the messages of its run.
#[derive(Clone, Debug, Default)]
pub struct Model {
    origin: Option<Time>,
    now: Time,
    decision: Option<DecisionMessage>,
    terms: Vec<ProposalTerms>,
    budgets: Vec<(String, f64)>,
    plugins: Plugins,
    latency: Latency,
    scene: Scene,
    strips: Strips,
    events: EventLog,
    pictures: Pictures,
    overlays: Overlays,
    setup: Setup,
    setup_version: u64,
}

impl Model {
    /// State at `now` of a recording that begins at `origin`, with the strips up to then.
    pub(crate) fn of_recording(origin: Time, now: Time, strips: Strips) -> Model {
        Model { origin: Some(origin), now, strips, ..Model::default() }
    }

    /// Sets the time of the robot's clock; it never goes back.
    pub fn set_time(&mut self, now: Time) {
        self.now = self.now.max(now);
    }

    /// Time of the robot's clock.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Seconds from the start of the run to `time`.
    pub fn seconds(&self, time: Time) -> f64 {
        time.seconds_after(self.origin.unwrap_or(self.now))
    }

    /// Newest decision; `None` before the first.
    pub fn decision(&self) -> Option<&DecisionMessage> {
        self.decision.as_ref()
    }

    /// Explanation of the newest decision, as `yamabico why` prints it; `None` before the first.
    pub fn explanation(&self) -> Option<Explanation> {
        Some(explain(self.decision.as_ref()?, &self.context()))
    }

    /// Strips of the last two minutes.
    pub fn strips(&self) -> &Strips {
        &self.strips
    }

    /// Log of the run.
    pub fn events(&self) -> &EventLog {
        &self.events
    }

    /// Newest pictures.
    pub fn pictures(&self) -> &Pictures {
        &self.pictures
    }

    /// Newest overlays.
    pub fn overlays(&self) -> &Overlays {
        &self.overlays
    }

    /// Description of the robot, and a number that grows when it changes.
    pub fn setup(&self) -> (Setup, u64) {
        let walls = self.scene.walls().cloned().collect();
        (Setup { walls, ..self.setup.clone() }, self.setup_version())
    }

    /// Number that grows when [`Model::setup`] changes.
    pub fn setup_version(&self) -> u64 {
        self.setup_version + self.scene.walls_version()
    }

    /// Takes in a file that a recording has attached: a map, or the task file.
    pub(crate) fn add_file(&mut self, text: &str) {
        self.setup.add_file(text);
        self.setup_version += 1;
    }

    /// Takes in a compressed picture of the camera `topic`.
    pub fn picture(&mut self, topic: &str, picture: Picture) {
        self.pictures.add(topic, picture);
    }

    /// State now.
    pub fn snapshot(&self) -> Snapshot {
        let decision = self.decision.as_ref();
        let explanation = self.explanation();
        let mode = decision.and_then(|decision| decision.header.mode());
        let (headline, axes) = match &explanation {
            Some(explanation) => (explanation.what.clone(), explanation.axes.clone()),
            None => ("waiting for the first decision".to_owned(), Vec::new()),
        };
        Snapshot {
            time_s: self.seconds(self.now),
            mode: mode.map_or("", Mode::as_str),
            headline,
            decision_age_s: decision.map(|decision| self.now.seconds_after(Time(decision.header.stamp_ns))),
            axes,
            behaviors: explanation.map(|explanation| self.behaviors(explanation)).unwrap_or_default(),
            sensors: self.plugins.sensors(self.now),
            latency: self.latency.summary(),
            scene: self.scene.view(self.now),
            pictures: self.pictures.views(self.now, &self.overlays),
        }
    }

    fn behaviors(&self, explanation: Explanation) -> Vec<BehaviorView> {
        let Some(decision) = &self.decision else { return Vec::new() };
        let views = explanation.behaviors.into_iter().map(|entry| {
            let verdict = decision.verdict(&entry.behavior);
            let terms = self.terms.iter().find(|terms| terms.behavior == entry.behavior);
            let is_disabled = |fault: u32| fault == Outcome::Disabled.code();
            let budget_s = self.budgets.iter().find(|(name, _)| *name == entry.behavior);
            let mut view = BehaviorView {
                priority: entry.priority,
                outcome: entry.outcome,
                why: entry.why,
                because: entry.because,
                process: entry.process,
                drives: verdict.is_some_and(|verdict| !verdict.won.is_empty()),
                enabled: !verdict
                    .is_some_and(|verdict| is_disabled(verdict.fault) || is_disabled(verdict.outcome)),
                kind: "",
                motion: None,
                control_share: self.strips.control_share(&entry.behavior),
                state: String::new(),
                restarts: 0,
                rate_hz: 0.0,
                age_s: None,
                max_age_s: terms.map(|terms| terms.max_age_s),
                evidence_age_s: None,
                max_evidence_age_s: terms.map(|terms| terms.max_evidence_age_s),
                calls: None,
                budget_ms: budget_s.map(|(_, budget_s)| budget_s * 1e3),
                name: entry.behavior,
            };
            self.plugins.complete(&mut view, self.now);
            view
        });
        views.collect()
    }

    fn context(&self) -> ExplainContext {
        ExplainContext {
            proposals: self.plugins.proposals.values().copied().collect(),
            processes: self.plugins.processes.values().copied().collect(),
            terms: self.terms.clone(),
        }
    }

    fn manifest(&mut self, manifest: &RobotManifest) {
        self.terms = manifest.terms();
        let behaviors =
            || manifest.plugins.iter().filter_map(|plugin| Some((&plugin.name, plugin.behavior?)));
        self.budgets =
            behaviors().filter_map(|(name, behavior)| Some((name.clone(), behavior.budget_s?))).collect();
        for (name, behavior) in behaviors() {
            if let Some(budget_s) = behavior.latency_budget_s {
                self.events.set_latency_budget(name, budget_s);
            }
        }
        let mut setup = Setup::of(manifest);
        if !self.setup.map.is_empty() {
            // The maps that a recording has attached are those of its time.
            setup.map.clone_from(&self.setup.map);
        }
        if setup != self.setup {
            self.setup = setup;
            self.setup_version += 1;
        }
    }
}

impl Tap for Model {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        self.origin.get_or_insert(time);
        self.set_time(time);
        self.events.message(topic, message, time, bytes, list);
        self.plugins.message(topic, message, bytes, list);
        self.scene.message(topic, message, time, bytes, list);
        match message.name {
            DecisionHeader::NAME => {
                let Some(header) = header::<DecisionHeader>(bytes) else { return };
                let stopped = matches!(header.mode(), Some(Mode::EmergencyStop | Mode::CriticalSilent));
                let (pose, truth) = (self.scene.position(), self.scene.true_position());
                self.strips.decision(Time(header.stamp_ns), &header, stopped, pose, truth);
                self.decision = Some(DecisionMessage { header, verdicts: read::items(list).collect() });
            }
            Command::NAME => {
                let Some(command) = header::<Command>(bytes) else { return };
                self.latency.add(&command);
            }
            FrameHeader::NAME => {
                let Some(header) = header::<FrameHeader>(bytes) else { return };
                if let Some(picture) = self.pictures.compress(topic, &header, list) {
                    self.pictures.add(topic, picture);
                }
            }
            OVERLAY => self.overlays.add(topic, &message.to_json(bytes, list)),
            RobotManifestHeader::NAME => {
                // A robot publishes it once, when it starts.
                if let (None, Some(header)) = (self.decision.as_ref(), header::<RobotManifestHeader>(bytes)) {
                    self.origin = self.origin.min(Some(Time(header.stamp_ns)));
                }
                if let Ok(manifest) = serde_json::from_slice(list) {
                    self.manifest(&manifest);
                }
            }
            RetuneHeader::NAME => {
                let Some(header) = header::<RetuneHeader>(bytes) else { return };
                self.setup_version += u64::from(self.setup.retune(&header, list));
            }
            _ => {}
        }
    }
}
