//! Plan of a run: a checked task turned into everything that is opened.

use std::sync::Arc;
use std::time::Duration;

use yamabico_core::behavior::MAX_SAVED_STATE_BYTES;
use yamabico_core::behavior::SlotInfo;
use yamabico_core::message::{
    self, CallBucket, CallHeader, CallsHeader, Command, Control, DecisionHeader, FailureHeader, FrameHeader,
    Goal, HeardHeader, Heartbeat, Message, MessageType, Name, OverlayHeader, OverlayMark, Process,
    ProcessesHeader, Proposal, RetuneHeader, RetunedHeader, RobotManifestHeader, SavedStateHeader,
    StepSignal, Stick, Truth, Verdict, WallPoint, WallsHeader,
};
use yamabico_core::overlay::MAX_MARKS;
use yamabico_core::sensor::SensorInfo;
use yamabico_host::bus::{Bus, BusError, Notification, RawSubscriber, STREAM_DEPTH, TopicSpec};
use yamabico_host::config::{self, Clock, InputSource, Task};
use yamabico_host::{
    BehaviorPlan, BehaviorSettings, DevicePlan, DurationHistogram, MAX_CALL_INPUTS, MAX_FAILURE_TEXT_BYTES,
    MAX_PARAMETER_BYTES, MAX_WALL_POINTS, Scheduling, topics,
};

use super::arbiter_core::MAX_HEARD;
use super::robot_manifest::MAX_MANIFEST_BYTES;
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, CriticalSensor, LatencyPolicy, Policy, TieRule, Wire};

/// Maximum number of items in one message of a behavior's output.
const MAX_OUTPUT_ITEMS: usize = 1024;
/// Messages of a stream that the recorder may lag behind.
const STREAM_TAP_DEPTH: usize = 1024;
/// Frames and overlays that the recorder may lag behind.
const FRAME_TAP_DEPTH: usize = 8;
/// Length of a list above which the recorder may lag behind by [`STREAM_DEPTH`] messages only, bytes.
const LONG_LIST_BYTES: usize = 64 * 1024;
/// Subscribers of a topic besides behaviors: arbiter, drive, recorder, tools, and dead processes.
const SPARE_READERS: usize = 12;

/// A topic of the run.
#[derive(Clone, Debug)]
pub struct Topic {
    /// Name.
    pub name: String,
    /// Message type.
    pub message: MessageType,
    /// Limits of its service.
    pub spec: TopicSpec,
}

/// Everything that is opened for a run, in the order in which it acts.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Topics: sensors, truth, behaviors by priority, decision, command, goal, control.
    pub topics: Vec<Topic>,
    /// Devices.
    pub devices: Vec<DevicePlan>,
    /// Behaviors, highest priority first, then by name.
    pub behaviors: Vec<BehaviorPlan>,
    /// Arbitration policy; behaviors in the same order.
    pub policy: Policy,
    /// Scheduling of the arbiter in a live run.
    pub scheduling: Scheduling,
    /// Owner of the clock in a live run.
    pub clock: Clock,
    /// Duration of one step of a driver's clock, unless the driver sets it.
    pub step: Duration,
    /// Maximum absolute coordinate of a goal, m; `None` without a map.
    pub max_goal_m: Option<f64>,
    /// Radius of the circle around the robot's footprint, m.
    pub radius_m: f64,
    /// Sensors by topic.
    pub sensors: Vec<(String, SensorInfo)>,
    /// Use of the behaviors' overlays.
    pub overlays: Overlays,
}

/// Use of the behaviors' overlays in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlays {
    /// Behaviors draw only for other subscribers, such as a live view.
    #[default]
    OnRequest,
    /// Behaviors draw in every call, for the recording.
    Recorded,
}

impl Plan {
    /// Plan of `task` for a run with this random `seed`.
    pub fn new(task: &Task, seed: u64) -> Plan {
        Plan {
            topics: topics(task),
            devices: devices(task, seed),
            behaviors: task.behaviors.iter().map(behavior_plan).collect(),
            policy: policy(task),
            scheduling: task.arbiter.scheduling,
            clock: task.robot.clock,
            step: task.run.step,
            max_goal_m: task.max_goal_m,
            overlays: Overlays::default(),
            radius_m: task.robot.robot.radius_m,
            sensors: sensors(task),
        }
    }

    /// Adds the topic of saved states, if it is missing, with room for every behavior.
    #[must_use]
    pub(crate) fn with_saved_states(mut self) -> Plan {
        if !self.topics.iter().any(|topic| topic.name == topics::SAVED_STATES) {
            let spec = TopicSpec {
                publishers: 2 * self.behaviors.len().max(1),
                subscribers: SPARE_READERS,
                list_bytes: MAX_SAVED_STATE_BYTES,
                ..TopicSpec::default()
            };
            let message = MessageType::of::<SavedStateHeader>();
            self.topics.push(Topic { name: topics::SAVED_STATES.to_owned(), message, spec });
        }
        self
    }

    /// The part of the plan that concerns the behavior `name`: its topics, and those that every behavior may use.
    #[must_use]
    pub(crate) fn of_behavior(&self, name: &str) -> Plan {
        let behaviors = self.behaviors.iter().filter(|behavior| behavior.setup.name == name);
        let behaviors: Vec<BehaviorPlan> = behaviors.cloned().collect();
        let inputs = behaviors.iter().flat_map(|behavior| behavior.inputs.iter().map(|(_, topic, _)| topic));
        let inputs: Vec<String> =
            inputs.cloned().chain([topics::COMMAND, topics::DECISION].map(str::to_owned)).collect();
        let own = topics::output(name, "");
        let is_used = |topic: &&Topic| inputs.contains(&topic.name) || topic.name.starts_with(&own);
        let topics = self.topics.iter().filter(is_used).cloned().collect();
        Plan { topics, behaviors, devices: Vec::new(), ..self.clone() }
    }

    /// Turns the plan into that of a live run: publishers notify subscribers, and plugins report on themselves.
    #[must_use]
    pub fn live(mut self) -> Plan {
        for topic in &mut self.topics {
            topic.spec.notification = Notification::On;
        }
        // Twice the live ones: the ports of dead processes stay until they are cleaned up.
        let publishers = 2 * (self.behaviors.len() + self.devices.len());
        let spec = |list_bytes| TopicSpec {
            publishers,
            subscribers: SPARE_READERS,
            list_bytes,
            ..TopicSpec::default()
        };
        let buckets = DurationHistogram::default().max_buckets() * size_of::<CallBucket>();
        let corners = MAX_WALL_POINTS * size_of::<WallPoint>();
        let reports = [
            (topics::HEARTBEATS, MessageType::of::<Heartbeat>(), 0),
            (topics::CALLS, MessageType::of::<CallsHeader>(), buckets),
            (topics::SAVED_STATES, MessageType::of::<SavedStateHeader>(), MAX_SAVED_STATE_BYTES),
            (topics::FAILURES, MessageType::of::<FailureHeader>(), MAX_FAILURE_TEXT_BYTES),
            (topics::WALLS, MessageType::of::<WallsHeader>(), corners),
            (topics::PROCESSES, MessageType::of::<ProcessesHeader>(), publishers * size_of::<Process>()),
            (topics::MANIFEST, MessageType::of::<RobotManifestHeader>(), MAX_MANIFEST_BYTES),
            (topics::RETUNE, MessageType::of::<RetuneHeader>(), MAX_PARAMETER_BYTES),
            (topics::RETUNED, MessageType::of::<RetunedHeader>(), MAX_FAILURE_TEXT_BYTES),
        ];
        self.topics.extend(reports.map(|(name, message, list_bytes)| Topic {
            name: name.to_owned(),
            message,
            spec: spec(list_bytes),
        }));
        // The recorder alone reads them.
        let logged = |name: String, message: MessageType, items: usize| Topic {
            name,
            message,
            spec: TopicSpec {
                publishers: 4,
                subscribers: 2,
                list_bytes: items * message.item_size,
                depth: STREAM_TAP_DEPTH / 2,
                ..TopicSpec::default()
            },
        };
        let calls = MessageType::of::<CallHeader>();
        let names = self.behaviors.iter().map(|behavior| topics::calls_of(&behavior.setup.name));
        let heard = logged(topics::HEARD.to_owned(), MessageType::of::<HeardHeader>(), MAX_HEARD);
        let logs: Vec<Topic> =
            names.map(|name| logged(name, calls, MAX_CALL_INPUTS)).chain([heard]).collect();
        self.topics.extend(logs);
        if self.clock == Clock::Driver {
            let readers = self.behaviors.len() * 2 + SPARE_READERS;
            let turn = MessageType::of::<StepSignal>();
            let step_topics = [
                (topics::CLOCK, MessageType::of::<message::Clock>(), 2, SPARE_READERS),
                (topics::STEP_ANNOUNCEMENTS, turn, 1, readers),
                (topics::STEP_ACKNOWLEDGMENTS, turn, publishers, SPARE_READERS),
            ];
            self.topics.extend(step_topics.map(|(name, message, publishers, subscribers)| Topic {
                name: name.to_owned(),
                message,
                spec: TopicSpec {
                    publishers,
                    subscribers,
                    depth: STREAM_TAP_DEPTH,
                    notification: Notification::On,
                    ..TopicSpec::default()
                },
            }));
        }
        self
    }

    /// Creates every topic.
    ///
    /// # Errors
    /// The bus fails.
    pub fn create_topics(&self, bus: &Bus) -> Result<(), BusError> {
        self.topics.iter().try_for_each(|topic| bus.create_raw(&topic.name, &topic.message, &topic.spec))
    }

    /// Opens a tap on every topic; on overlays only if they are recorded, since a subscriber makes behaviors draw.
    ///
    /// # Errors
    /// The bus fails.
    pub fn taps(&self, bus: &Bus) -> Result<Vec<(String, MessageType, RawSubscriber)>, BusError> {
        let is_tapped =
            |topic: &&Topic| topic.message.name != OverlayHeader::NAME || self.overlays == Overlays::Recorded;
        let tap =
            |topic: &Topic| Ok((topic.name.clone(), topic.message, bus.tap(&topic.name, &topic.message)?));
        self.topics.iter().filter(is_tapped).map(tap).collect()
    }
}

/// Sensors of a task by topic.
pub(crate) fn sensors(task: &Task) -> Vec<(String, SensorInfo)> {
    let sensors = task.robot.sensors.iter();
    sensors.map(|sensor| (topics::sensor(&sensor.part.name), sensor.info.clone())).collect()
}

fn topics(task: &Task) -> Vec<Topic> {
    let readers = task.behaviors.len() + SPARE_READERS;
    let topic = |name: String, message: MessageType, publishers: usize, list_bytes: usize| {
        let is_large = [FrameHeader::NAME, OverlayHeader::NAME].contains(&message.name);
        let depth = match is_large {
            true => FRAME_TAP_DEPTH,
            // Memory is reserved for every message that a tap may lag behind.
            false if list_bytes > LONG_LIST_BYTES => STREAM_DEPTH,
            false => STREAM_TAP_DEPTH,
        };
        Topic {
            name,
            message,
            spec: TopicSpec {
                publishers,
                subscribers: readers,
                list_bytes,
                depth,
                notification: Notification::Off,
            },
        }
    };
    let mut all = Vec::new();
    for sensor in &task.robot.sensors {
        let message = MessageType::find(sensor.info.message).copied();
        all.extend(
            message
                .map(|message| topic(topics::sensor(&sensor.part.name), message, 2, sensor.max_item_bytes)),
        );
    }
    all.push(topic(topics::TRUTH.into(), MessageType::of::<Truth>(), 2, 0));
    for behavior in &task.behaviors {
        let output = |slot: &SlotInfo| {
            let bytes = slot.message.item_size * MAX_OUTPUT_ITEMS;
            topic(topics::output(&behavior.name, &slot.name), slot.message, 2, bytes)
        };
        all.extend(behavior.factory.info().outputs.iter().map(output));
        let marks = MAX_MARKS * size_of::<OverlayMark>();
        all.push(topic(topics::overlay(&behavior.name), MessageType::of::<OverlayHeader>(), 2, marks));
        all.push(topic(topics::proposal(&behavior.name), MessageType::of::<Proposal>(), 1, 0));
    }
    let verdicts = task.behaviors.len() * size_of::<Verdict>();
    all.push(topic(topics::DECISION.into(), MessageType::of::<DecisionHeader>(), 1, verdicts));
    all.push(topic(topics::COMMAND.into(), MessageType::of::<Command>(), 1, 0));
    all.push(topic(topics::GOAL.into(), MessageType::of::<Goal>(), 1, 0));
    all.push(topic(topics::STICK.into(), MessageType::of::<Stick>(), 4, 0));
    let control = topic(topics::CONTROL.into(), MessageType::of::<Control>(), 8, MAX_PARAMETER_BYTES);
    all.push(Topic { spec: TopicSpec { depth: STREAM_DEPTH, ..control.spec }, ..control });
    all
}

fn devices(task: &Task, seed: u64) -> Vec<DevicePlan> {
    let of_device = |device: &str| {
        let sensors = task.robot.sensors.iter().filter(|sensor| sensor.device == device);
        let typed = sensors
            .filter_map(|sensor| Some((sensor.part.name.clone(), *MessageType::find(sensor.info.message)?)));
        typed.collect()
    };
    let specs = task.robot.specs(seed).into_iter();
    let settings = task.robot.devices.iter().map(|device| device.settings.clone());
    specs
        .zip(settings)
        .map(|((driver, spec), settings)| {
            let sensors = of_device(&spec.name);
            DevicePlan { driver, sensors, spec, settings }
        })
        .collect()
}

fn behavior_plan(behavior: &config::BehaviorFile) -> BehaviorPlan {
    let slot_type = |slot: &str| {
        behavior.factory.info().inputs.iter().find(|info| info.name == slot).map(|info| info.message)
    };
    let topic = |source: &InputSource, message: &MessageType| match source {
        InputSource::Sensor(name) => topics::sensor(name),
        InputSource::Output { behavior, output } => topics::output(behavior, output),
        InputSource::Operator if message.name == Stick::NAME => topics::STICK.to_owned(),
        InputSource::Operator => topics::GOAL.to_owned(),
        InputSource::Arbiter => topics::DECISION.to_owned(),
    };
    let inputs = behavior.inputs.iter();
    BehaviorPlan {
        factory: Arc::clone(&behavior.factory),
        table: behavior.table.clone(),
        setup: behavior.setup.clone(),
        inputs: inputs
            .filter_map(|input| {
                let message = slot_type(&input.slot)?;
                Some((input.slot.clone(), topic(&input.source, &message), message))
            })
            .collect(),
        settings: behavior.settings.clone(),
    }
}

/// Arbitration policy of the behavior `name`, from its settings.
fn behavior_policy(name: &str, settings: &BehaviorSettings) -> BehaviorPolicy {
    BehaviorPolicy {
        name: Name::new(name),
        priority: settings.priority,
        critical: settings.critical,
        enabled: settings.enabled,
        deadline: settings.host.deadline.proposal_timeout(),
        max_age: settings.max_age,
        max_evidence_age: settings.max_evidence_age,
        latency_budget: settings.latency_budget,
        sleeps: settings.sleeps_while_inhibited,
        hold: settings.hold,
        dwell: settings.dwell,
    }
}

fn policy(task: &Task) -> Policy {
    let behaviors = task.behaviors.iter().map(|behavior| behavior_policy(&behavior.name, &behavior.settings));
    let index = |name: &str| task.behaviors.iter().position(|behavior| behavior.name == name);
    let wire = |make: fn(usize, usize, Duration) -> Wire| {
        move |wire: &config::Wire| Some(make(index(&wire.by)?, index(&wire.what)?, wire.hold))
    };
    let inhibit = task.inhibit.iter().filter_map(wire(Wire::inhibit));
    let suppress = task.suppress.iter().filter_map(wire(Wire::suppress));
    let robot = &task.robot;
    let critical = robot.sensors.iter().filter(|sensor| sensor.critical);
    Policy {
        wires: inhibit.chain(suppress).collect(),
        sensors: critical
            .map(|sensor| CriticalSensor { name: Name::new(&sensor.part.name), max_age: sensor.max_age })
            .collect(),
        ties: match task.arbiter.policy {
            config::Policy::Strict => TieRule::Strict,
            config::Policy::Blend => TieRule::Blend,
        },
        latency_policy: if task.arbiter.latency_slows { LatencyPolicy::Slow } else { LatencyPolicy::Count },
        rate_hz: 1.0 / task.arbiter.period.as_secs_f64(),
        ..Policy::new(
            robot.robot.limits,
            Kinematics::new(robot.drive.axes, robot.drive.wheels.as_ref()),
            behaviors.collect(),
        )
    }
}
