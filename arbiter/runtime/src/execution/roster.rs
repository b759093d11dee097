//! Who works on a live robot and what they tell each other, for whoever joins it.

use serde::{Deserialize, Serialize};
use yamabico_core::message::RosterHeader;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher};
use yamabico_host::config::Isolation;
use yamabico_host::{Hosting, topics};

use super::plan::Plan;

/// Longest roster, bytes of JSON.
pub(super) const MAX_ROSTER: usize = 128 * 1024;

/// The plugins and topics of a live robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Roster {
    /// Its name.
    pub robot: String,
    /// The process of arbiter, supervisor and recorder.
    pub pid: u32,
    /// Devices, then behaviors, the highest priority first.
    pub plugins: Vec<Enrolled>,
    /// Every topic.
    pub topics: Vec<Posted>,
}

/// A plugin on the roster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Enrolled {
    /// Its name in the task or robot file.
    pub name: String,
    /// Which behavior or driver it is.
    pub plugin: String,
    /// Whether it has a process of its own.
    pub own_process: bool,
    /// The program that it is, and its arguments; empty where it is a part of the robot's.
    pub exec: Vec<String>,
    /// It hangs when it shows no sign of life for longer, seconds.
    pub patience_s: f64,
    /// What it is held to, where it is a behavior.
    pub behavior: Option<Duties>,
}

/// What a behavior is held to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Duties {
    /// Higher wins.
    pub priority: i32,
    /// Oldest stamp that is heard, seconds.
    pub max_age_s: f64,
    /// Oldest evidence that is heard, seconds.
    pub max_evidence_age_s: f64,
    /// Longest silence, of a critical one, seconds.
    pub deadline_s: Option<f64>,
}

/// A topic on the roster.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Posted {
    /// Its name.
    pub name: String,
    /// What it carries, such as `yamabico.Odometry.v1`.
    pub message: String,
    /// Who publishes on it, in words.
    pub by: String,
}

impl Roster {
    /// That of `plan`; plugins have processes of their own only where `may_part`.
    pub(super) fn of(plan: &Plan, robot: &str, may_part: MayPart) -> Roster {
        let own_process =
            |hosting: &Hosting| may_part == MayPart::Yes && hosting.isolation == Isolation::Process;
        let devices = plan.devices.iter().map(|device| Enrolled {
            name: device.spec.name.clone(),
            plugin: device.driver.info().name.clone(),
            own_process: own_process(&device.hosting),
            exec: Vec::new(),
            patience_s: device.hosting.patience.as_secs_f64(),
            behavior: None,
        });
        let behaviors = plan.behaviors.iter().map(|behavior| Enrolled {
            name: behavior.setup.name.clone(),
            plugin: behavior.factory.info().name.clone(),
            own_process: own_process(&behavior.hosting),
            exec: behavior.exec.clone(),
            patience_s: behavior.hosting.patience.as_secs_f64(),
            behavior: duties(plan, &behavior.setup.name),
        });
        let posted = plan.topics.iter().map(|topic| Posted {
            name: topic.name.clone(),
            message: topic.message.name.to_owned(),
            by: publisher(plan, &topic.name),
        });
        Roster {
            robot: robot.to_owned(),
            pid: std::process::id(),
            plugins: devices.chain(behaviors).collect(),
            topics: posted.collect(),
        }
    }
}

/// Whether plugins may have processes of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MayPart {
    /// Those whose file says so have.
    Yes,
    /// Everybody has a thread.
    No,
}

fn duties(plan: &Plan, behavior: &str) -> Option<Duties> {
    let policy = &plan.policy.behaviors[plan.policy.find(behavior)?];
    Some(Duties {
        priority: policy.priority,
        max_age_s: policy.max_age.as_secs_f64(),
        max_evidence_age_s: policy.max_evidence_age.as_secs_f64(),
        deadline_s: policy.critical.then_some(policy.deadline.as_secs_f64()),
    })
}

fn publisher(plan: &Plan, topic: &str) -> String {
    let has = |name: &str| {
        let is_it = |(sensor, _): &(String, _)| topics::sensor(sensor) == name;
        plan.devices.iter().find(|device| device.sensors.iter().any(is_it))
    };
    let behavior = || {
        let begins = |name: &str| topic.starts_with(&topics::output(name, ""));
        plan.behaviors.iter().map(|behavior| &behavior.setup.name).find(|name| begins(name))
    };
    match topic {
        topics::COMMAND | topics::DECISION | topics::GOAL => "arbiter".to_owned(),
        topics::CONTROL | topics::STICK => "operators".to_owned(),
        topics::PROCESSES | topics::ROSTER | topics::RETUNE => "robot".to_owned(),
        topics::RETUNED | topics::CALLS | topics::MEMORIES => "behaviors".to_owned(),
        topics::TRUTH | topics::WALLS => "simulators".to_owned(),
        topics::HEARTBEATS | topics::FAILURES => "plugins".to_owned(),
        _ => match has(topic) {
            Some(device) => device.spec.name.clone(),
            None => behavior().map_or_else(String::new, Clone::clone),
        },
    }
}

/// Tells the roster to everybody who joins.
pub(super) struct Herald(Publisher<RosterHeader>);

impl Herald {
    /// Tells it for the first time.
    pub fn start(bus: &Bus, roster: &Roster) -> Result<Herald, BusError> {
        let publisher = bus.publisher(topics::ROSTER)?;
        let text = serde_json::to_string(roster).unwrap_or_default();
        let header = RosterHeader { stamp_ns: Time::monotonic_now().0, sequence: 1 };
        publisher.publish(&header, text.as_bytes())?;
        Ok(Herald(publisher))
    }

    /// Tells it to those who have joined since. Whoever is not told asks in vain, and nothing else comes of it.
    pub fn welcome(&self) {
        if let Err(error) = self.0.welcome() {
            tracing::debug!("a newcomer is not told who is here: {error}");
        }
    }
}
