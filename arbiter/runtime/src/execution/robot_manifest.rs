//! Manifest of a live robot: its plugins and topics, for clients.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;
use yamabico_arbiter::decide::ProposalTerms;
use yamabico_core::message::{MessageDeclaration, RobotManifestHeader};
use yamabico_core::sensor::SensorInfo;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher};
use yamabico_host::config::{Isolation, Parameter, describe_parameters};
use yamabico_host::{BehaviorPlan, HostSettings, topics};

use super::plan::Plan;

/// Maximum size of a manifest, bytes of JSON.
pub(super) const MAX_MANIFEST_BYTES: usize = 128 * 1024;

/// Plugins and topics of a live robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotManifest {
    /// Name of the robot.
    pub robot: String,
    /// Process of arbiter, supervisor and recorder.
    pub pid: u32,
    /// Devices, then behaviors, the highest priority first.
    pub plugins: Vec<PluginEntry>,
    /// Topics.
    pub topics: Vec<TopicEntry>,
    /// Maximum absolute coordinate of a goal, m; `None` without a map.
    pub max_goal_m: Option<f64>,
    /// Radius of the circle around the robot's footprint, m.
    pub radius_m: f64,
    /// Sensors by topic.
    pub sensors: Vec<(String, SensorInfo)>,
}

/// A plugin of a manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PluginEntry {
    /// Name in the task or robot file.
    pub name: String,
    /// Type of the behavior or driver.
    pub plugin: String,
    /// Set if it has a process of its own.
    pub own_process: bool,
    /// External program and its arguments; empty for a plugin that is built in.
    pub exec: Vec<String>,
    /// Time without a heartbeat after which it counts as hung, s.
    pub hang_timeout_s: f64,
    /// Arbitration settings of a behavior; `None` for a device.
    pub behavior: Option<BehaviorEntry>,
    /// Parameters of a behavior, with their values at the start of the run.
    pub parameters: Vec<ParameterEntry>,
    /// Folder that paths in these parameters start from.
    pub folder: PathBuf,
    /// Topics that it receives.
    pub inputs: Vec<String>,
}

/// A parameter of a manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterEntry {
    /// Key; dotted inside a table.
    pub key: String,
    /// Type, or the allowed strings.
    pub takes: String,
    /// Unit.
    pub unit: Option<String>,
    /// Minimum and maximum, such as `0.05 to 10`.
    pub range: Option<String>,
    /// Value, or its default; `None` if it has neither.
    pub value: Option<Json>,
    /// Meaning.
    pub summary: String,
}

/// Arbitration settings of a behavior of a manifest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BehaviorEntry {
    /// Priority; the higher one wins.
    pub priority: i32,
    /// Maximum age of a proposal's stamp, s.
    pub max_age_s: f64,
    /// Maximum age of a proposal's evidence, s.
    pub max_evidence_age_s: f64,
    /// Maximum silence of a critical behavior, s; `None` if it is not critical.
    pub deadline_s: Option<f64>,
    /// Age of the data behind a command above which it is late, s; `None` without such a budget.
    pub latency_budget_s: Option<f64>,
    /// Computing time of one call above which it is an overrun, s; `None` without a budget.
    pub budget_s: Option<f64>,
}

/// A topic of a manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicEntry {
    /// Name.
    pub name: String,
    /// Message type, such as `yamabico.Odometry.v1`.
    pub message: String,
    /// Publisher: the name of a plugin, or a group such as `operators`.
    pub publisher: String,
    /// Layout of a message type that a plugin declares; none for one of Yamabico.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declares: Option<MessageDeclaration>,
}

/// Placement of plugins whose settings ask for a process of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProcessPolicy {
    /// In a process of their own.
    Separate,
    /// On a thread of the robot's process.
    Threads,
}

impl RobotManifest {
    /// Manifest of `plan` for the robot of this name.
    pub(super) fn new(plan: &Plan, robot: &str, policy: ProcessPolicy) -> RobotManifest {
        let own_process =
            |host: &HostSettings| policy == ProcessPolicy::Separate && host.isolation == Isolation::Process;
        let devices = plan.devices.iter().map(|device| PluginEntry {
            name: device.spec.name.clone(),
            plugin: device.driver.info().name.clone(),
            own_process: own_process(&device.settings),
            exec: Vec::new(),
            hang_timeout_s: device.settings.deadline.hang_timeout().as_secs_f64(),
            behavior: None,
            parameters: Vec::new(),
            folder: PathBuf::new(),
            inputs: Vec::new(),
        });
        let behaviors = plan.behaviors.iter().map(|behavior| PluginEntry {
            name: behavior.setup.name.clone(),
            plugin: behavior.factory.info().name.clone(),
            own_process: own_process(&behavior.settings.host),
            exec: behavior.settings.host.exec.clone(),
            hang_timeout_s: behavior.settings.host.deadline.hang_timeout().as_secs_f64(),
            behavior: behavior_entry(plan, behavior),
            parameters: parameters(&behavior.factory.info().parameters, &behavior.table),
            folder: std::path::absolute(&behavior.setup.folder).unwrap_or_default(),
            inputs: behavior.inputs.iter().map(|(_, topic, _)| topic.clone()).collect(),
        });
        let topics = plan.topics.iter().map(|topic| TopicEntry {
            name: topic.name.clone(),
            message: topic.message.name.to_owned(),
            publisher: publisher(plan, &topic.name),
            declares: (!topic.message.is_built_in()).then(|| topic.message.declaration()),
        });
        RobotManifest {
            robot: robot.to_owned(),
            pid: std::process::id(),
            plugins: devices.chain(behaviors).collect(),
            topics: topics.collect(),
            max_goal_m: plan.max_goal_m,
            radius_m: plan.radius_m,
            sensors: plan.sensors.clone(),
        }
    }

    /// Maximum ages and deadlines of the behaviors, to explain decisions.
    pub fn terms(&self) -> Vec<ProposalTerms> {
        let behaviors = self.plugins.iter().filter_map(|plugin| Some((plugin, plugin.behavior?)));
        let terms = behaviors.map(|(plugin, behavior)| ProposalTerms {
            behavior: plugin.name.clone(),
            max_age_s: behavior.max_age_s,
            max_evidence_age_s: behavior.max_evidence_age_s,
            deadline_s: behavior.deadline_s,
        });
        terms.collect()
    }

    /// JSON for the bus; without parameters and sensors if they take too much space.
    fn to_json(&self) -> String {
        let text = serde_json::to_string(self).unwrap_or_default();
        if text.len() <= MAX_MANIFEST_BYTES {
            return text;
        }
        let mut short = self.clone();
        short.plugins.iter_mut().for_each(|plugin| plugin.parameters.clear());
        short.sensors.clear();
        serde_json::to_string(&short).unwrap_or_default()
    }
}

/// Parameters of this schema with their values in `table`.
fn parameters(schema: &Json, table: &toml::Table) -> Vec<ParameterEntry> {
    let value = |key: &str| {
        let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
        let found = table.get(first)?;
        let keys = rest.into_iter().flat_map(|rest| rest.split('.'));
        let found = keys.into_iter().try_fold(found, |value, key| value.get(key))?;
        serde_json::to_value(found).ok()
    };
    let entry = |parameter: Parameter| ParameterEntry {
        value: value(&parameter.key).or(parameter.default),
        key: parameter.key,
        takes: parameter.takes,
        unit: parameter.unit.map(str::to_owned),
        range: parameter.range,
        summary: parameter.summary,
    };
    describe_parameters(schema).into_iter().map(entry).collect()
}

fn behavior_entry(plan: &Plan, behavior: &BehaviorPlan) -> Option<BehaviorEntry> {
    let policy = &plan.policy.behaviors[plan.policy.find(&behavior.setup.name)?];
    Some(BehaviorEntry {
        priority: policy.priority,
        max_age_s: policy.max_age.as_secs_f64(),
        max_evidence_age_s: policy.max_evidence_age.as_secs_f64(),
        deadline_s: policy.critical.then_some(policy.deadline.as_secs_f64()),
        latency_budget_s: policy.latency_budget.map(|budget| budget.as_secs_f64()),
        budget_s: behavior.settings.budget.map(|budget| budget.as_secs_f64()),
    })
}

fn publisher(plan: &Plan, topic: &str) -> String {
    let device = || {
        plan.devices
            .iter()
            .find(|device| device.sensors.iter().any(|(sensor, _)| topics::sensor(sensor) == topic))
    };
    let behavior = || {
        let publishes = |name: &&String| topic.starts_with(&topics::output(name, ""));
        plan.behaviors.iter().map(|behavior| &behavior.setup.name).find(publishes)
    };
    match topic {
        topics::COMMAND | topics::DECISION | topics::GOAL => "arbiter".to_owned(),
        topics::CONTROL | topics::STICK => "operators".to_owned(),
        topics::PROCESSES | topics::MANIFEST | topics::RETUNE => "robot".to_owned(),
        topics::RETUNED | topics::CALLS | topics::SAVED_STATES => "behaviors".to_owned(),
        topics::TRUTH | topics::WALLS => "simulators".to_owned(),
        topics::HEARTBEATS | topics::FAILURES => "plugins".to_owned(),
        _ => match device() {
            Some(device) => device.spec.name.clone(),
            None => behavior().map_or_else(String::new, Clone::clone),
        },
    }
}

/// Publishes the manifest to every client that joins.
pub(super) struct ManifestPublisher(Publisher<RobotManifestHeader>);

impl ManifestPublisher {
    /// Publishes `manifest` for the first time.
    pub fn start(bus: &Bus, manifest: &RobotManifest) -> Result<ManifestPublisher, BusError> {
        let publisher = bus.publisher(topics::MANIFEST)?;
        let text = manifest.to_json();
        let header = RobotManifestHeader { stamp_ns: Time::monotonic_now().0, sequence: 1 };
        publisher.publish(&header, text.as_bytes())?;
        Ok(ManifestPublisher(publisher))
    }

    /// Resends the manifest to new subscribers. If that fails, their client reports it.
    pub fn serve_new_subscribers(&self) {
        if let Err(error) = self.0.resend_to_new_subscribers() {
            tracing::debug!("could not resend the manifest to new subscribers: {error}");
        }
    }
}
