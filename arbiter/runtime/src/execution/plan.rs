//! From a checked task to everything that is opened for a run.

use std::sync::Arc;
use std::time::Duration;

use yamabico_core::behavior::MAX_MEMORY_BYTES;
use yamabico_core::behavior::SlotInfo;
use yamabico_core::message::{
    self, CallBucket, CallsHeader, Command, Control, DecisionHeader, FailureHeader, FrameHeader, Goal,
    Heartbeat, MemoryHeader, Message, MessageType, Name, Process, ProcessesHeader, Proposal, RetuneHeader,
    RetunedHeader, RosterHeader, Stick, Truth, Turn, Verdict, WallPoint, WallsHeader,
};
use yamabico_host::bus::{Bell, Bus, BusError, STREAM_DEPTH, Spec};
use yamabico_host::config::{self, Clock, InputSource, Task};
use yamabico_host::{
    BehaviorPlan, DevicePlan, Durations, Hosting, MAX_CORNERS, MAX_PARAMETERS, MAX_WORDS, Scheduling, topics,
};

use super::roster::MAX_ROSTER;
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, Contest, CriticalSensor, Lateness, Policy, Wire};

/// Items that an output of a behavior may carry in one message.
const MAX_OUTPUT_ITEMS: usize = 1024;
/// Messages of a stream, and pictures, that the recorder may fall behind.
const STREAM_TAP_DEPTH: usize = 1024;
const FRAME_TAP_DEPTH: usize = 8;
/// Readers that a topic has room for beside its behaviors: arbiter, drive, recorder, tools, and the dead.
const SPARE_READERS: usize = 12;

/// A channel of the run.
#[derive(Clone, Debug)]
pub struct Topic {
    /// What it is called.
    pub name: String,
    /// What it carries.
    pub message: MessageType,
    /// Its limits.
    pub spec: Spec,
}

/// Everything that is opened for a run, in the order in which it acts.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Every channel: sensors, truth, behaviors by priority, decision, command, goal, control.
    pub topics: Vec<Topic>,
    /// The devices.
    pub devices: Vec<DevicePlan>,
    /// The behaviors, highest priority first, then by name.
    pub behaviors: Vec<BehaviorPlan>,
    /// How proposals become a command; behaviors in the same order.
    pub policy: Policy,
    /// Live: what is asked of the system's scheduler for the arbiter.
    pub scheduling: Scheduling,
    /// Whose clock counts live.
    pub clock: Clock,
    /// One step of a clock that is a driver's, unless it knows better.
    pub step: Duration,
}

impl Plan {
    /// The plan of `task` with the run's `seed`.
    pub fn new(task: &Task, seed: u64) -> Plan {
        Plan {
            topics: topics(task),
            devices: devices(task, seed),
            behaviors: task.behaviors.iter().map(|behavior| behavior_plan(task, behavior)).collect(),
            policy: policy(task),
            scheduling: task.arbiter.scheduling,
            clock: task.robot.clock,
            step: task.run.step,
        }
    }

    /// Makes the plan that of a live run: whoever publishes wakes those who wait, and plugins tell how they fare.
    #[must_use]
    pub fn live(mut self) -> Plan {
        for topic in &mut self.topics {
            topic.spec.bell = Bell::Rings;
        }
        // The dead keep their places until they are cleaned up.
        let publishers = 2 * (self.behaviors.len() + self.devices.len());
        let spec =
            |list_bytes| Spec { publishers, subscribers: SPARE_READERS, list_bytes, ..Spec::default() };
        let buckets = Durations::default().max_buckets() * size_of::<CallBucket>();
        let corners = MAX_CORNERS * size_of::<WallPoint>();
        let told = [
            (topics::HEARTBEATS, MessageType::of::<Heartbeat>(), 0),
            (topics::CALLS, MessageType::of::<CallsHeader>(), buckets),
            (topics::MEMORIES, MessageType::of::<MemoryHeader>(), MAX_MEMORY_BYTES),
            (topics::FAILURES, MessageType::of::<FailureHeader>(), MAX_WORDS),
            (topics::WALLS, MessageType::of::<WallsHeader>(), corners),
            (topics::PROCESSES, MessageType::of::<ProcessesHeader>(), publishers * size_of::<Process>()),
            (topics::ROSTER, MessageType::of::<RosterHeader>(), MAX_ROSTER),
            (topics::RETUNE, MessageType::of::<RetuneHeader>(), MAX_PARAMETERS),
            (topics::RETUNED, MessageType::of::<RetunedHeader>(), MAX_WORDS),
        ];
        self.topics.extend(told.map(|(name, message, list_bytes)| Topic {
            name: name.to_owned(),
            message,
            spec: spec(list_bytes),
        }));
        if self.clock == Clock::Driver {
            let readers = self.behaviors.len() * 2 + SPARE_READERS;
            let turn = MessageType::of::<Turn>();
            let paced = [
                (topics::CLOCK, MessageType::of::<message::Clock>(), 2, SPARE_READERS),
                (topics::TURNS, turn, 1, readers),
                (topics::TAKEN, turn, publishers, SPARE_READERS),
            ];
            self.topics.extend(paced.map(|(name, message, publishers, subscribers)| Topic {
                name: name.to_owned(),
                message,
                spec: Spec {
                    publishers,
                    subscribers,
                    depth: STREAM_TAP_DEPTH,
                    bell: Bell::Rings,
                    ..Spec::default()
                },
            }));
        }
        self
    }

    /// Creates every channel.
    ///
    /// # Errors
    /// The transport failed.
    pub fn create_topics(&self, bus: &Bus) -> Result<(), BusError> {
        self.topics.iter().try_for_each(|topic| bus.create_raw(&topic.name, &topic.message, &topic.spec))
    }
}

fn topics(task: &Task) -> Vec<Topic> {
    let readers = task.behaviors.len() + SPARE_READERS;
    let topic = |name: String, message: MessageType, publishers: usize, list_bytes: usize| {
        let depth = if message.name == FrameHeader::NAME { FRAME_TAP_DEPTH } else { STREAM_TAP_DEPTH };
        Topic {
            name,
            message,
            spec: Spec { publishers, subscribers: readers, list_bytes, depth, bell: Bell::Silent },
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
        all.push(topic(topics::proposal(&behavior.name), MessageType::of::<Proposal>(), 1, 0));
    }
    let verdicts = task.behaviors.len() * size_of::<Verdict>();
    all.push(topic(topics::DECISION.into(), MessageType::of::<DecisionHeader>(), 1, verdicts));
    all.push(topic(topics::COMMAND.into(), MessageType::of::<Command>(), 1, 0));
    all.push(topic(topics::GOAL.into(), MessageType::of::<Goal>(), 1, 0));
    all.push(topic(topics::STICK.into(), MessageType::of::<Stick>(), 4, 0));
    let control = topic(topics::CONTROL.into(), MessageType::of::<Control>(), 8, MAX_PARAMETERS);
    all.push(Topic { spec: Spec { depth: STREAM_DEPTH, ..control.spec }, ..control });
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
    let hosting = |device: &config::DeviceFile| Hosting {
        isolation: device.isolation,
        patience: device.patience,
        scheduling: device.scheduling,
    };
    let hostings = task.robot.devices.iter().map(hosting);
    let plans = specs.zip(hostings).zip(task.robot.devices.iter().map(|device| device.exec.clone()));
    plans
        .map(|(((driver, spec), hosting), exec)| {
            let sensors = of_device(&spec.name);
            DevicePlan { driver, sensors, spec, hosting, exec }
        })
        .collect()
}

fn behavior_plan(task: &Task, behavior: &config::BehaviorFile) -> BehaviorPlan {
    let slot_type = |slot: &str| {
        behavior.factory.info().inputs.iter().find(|info| info.name == slot).map(|info| info.message)
    };
    let topic = |source: &InputSource, message: &MessageType| match source {
        InputSource::Sensor(name) => topics::sensor(name),
        InputSource::Output { behavior, output } => topics::output(behavior, output),
        InputSource::Operator if message.name == Stick::NAME => topics::STICK.to_owned(),
        InputSource::Operator => topics::GOAL.to_owned(),
    };
    let inputs = behavior.inputs.iter();
    let period = behavior.period.or_else(|| behavior.critical.then_some(behavior.deadline / 3));
    BehaviorPlan {
        factory: Arc::clone(&behavior.factory),
        table: behavior.table.clone(),
        setup: behavior.setup.clone(),
        priority: behavior.priority,
        inputs: inputs
            .filter_map(|input| {
                let message = slot_type(&input.slot)?;
                Some((input.slot.clone(), topic(&input.source, &message), message))
            })
            .collect(),
        // Without any input it would never be asked: it is asked every tick.
        period: period.or_else(|| behavior.inputs.is_empty().then_some(task.arbiter.period)),
        budget: behavior.budget,
        sleeps: behavior.sleeps,
        hosting: Hosting {
            isolation: behavior.isolation,
            patience: behavior.patience,
            scheduling: behavior.scheduling,
        },
        exec: behavior.exec.clone(),
    }
}

fn policy(task: &Task) -> Policy {
    let behaviors = task.behaviors.iter().map(|behavior| BehaviorPolicy {
        name: Name::new(&behavior.name),
        priority: behavior.priority,
        critical: behavior.critical,
        enabled: behavior.enabled,
        deadline: behavior.deadline,
        max_age: behavior.max_age,
        max_evidence_age: behavior.max_evidence_age,
        latency_budget: behavior.latency_budget,
        sleeps: behavior.sleeps,
        hold: behavior.hold,
        dwell: behavior.dwell,
    });
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
        contest: match task.arbiter.policy {
            config::Policy::Strict => Contest::Strict,
            config::Policy::Blend => Contest::Blend,
        },
        lateness: if task.arbiter.latency_slows { Lateness::Slows } else { Lateness::Counts },
        rate_hz: 1.0 / task.arbiter.period.as_secs_f64(),
        ..Policy::new(
            robot.robot.limits,
            Kinematics::new(robot.drive.axes, robot.drive.wheels.as_ref()),
            behaviors.collect(),
        )
    }
}
