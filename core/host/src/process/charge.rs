//! What a plugin in a process of its own is charged with.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::config::{Clock, Isolation};
use crate::{BehaviorPlan, DevicePlan, Hosting, Scheduling, topics};
use yamabico_core::behavior::Setup;
use yamabico_core::driver::DeviceSpec;
use yamabico_core::message::MessageType;
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{Robot, SensorInfo};

/// The version of what [`Charge`] holds.
pub const PROTOCOL: u32 = 1;

/// Everything that a plugin's process is told, once, as TOML on its standard input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Charge {
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Its name in the task or robot file.
    pub name: String,
    /// The running robot whose bus it joins.
    pub robot: String,
    /// The folder of the transport's files (iceoryx2: `global.root-path`).
    pub bus_root: PathBuf,
    /// The start of their names (iceoryx2: `global.prefix`).
    pub bus_prefix: String,
    /// Times that it was started again.
    pub restarts: u32,
    /// It beats at least this often, milliseconds.
    pub beat_ms: f64,
    /// When it begins.
    pub begin: Begin,
    /// What its predecessor remembered, JSON; empty where there is none, or it remembered nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub memory: String,
    /// Whose clock counts.
    #[serde(default)]
    pub clock: Clock,
    /// What it is.
    pub part: Part,
}

/// When a plugin that is ready begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Begin {
    /// With the first command that the arbiter gives.
    WithTheFirstCommand,
    /// At once: the others are at work.
    AtOnce,
}

/// What a plugin is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// It proposes.
    Behavior(BehaviorCharge),
    /// It measures and moves.
    Device(DeviceCharge),
}

/// What a behavior is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BehaviorCharge {
    /// Which of the program's behaviors.
    pub plugin: String,
    /// Stamped onto its proposals.
    pub priority: i32,
    /// The topic of its proposals.
    pub proposal: String,
    /// It is asked at least this often, milliseconds; none for new input only.
    pub period_ms: Option<f64>,
    /// Longer calls count as overruns, milliseconds.
    pub budget_ms: Option<f64>,
    /// It need not be asked while its verdict on `decision` is `inhibited`.
    #[serde(default)]
    pub sleeps_while_inhibited: bool,
    /// Relative paths in its parameters start here.
    pub folder: PathBuf,
    /// Its parameters, checked against its schema.
    pub parameters: toml::Table,
    /// The robot.
    pub robot: Robot,
    /// What is plugged into its slots.
    pub inputs: Vec<InputCharge>,
    /// What it publishes.
    pub outputs: Vec<PortCharge>,
}

/// What is plugged into a slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InputCharge {
    /// The slot and the topic.
    #[serde(flatten)]
    pub port: PortCharge,
    /// The sensor behind it, where it is one.
    pub sensor: Option<SensorInfo>,
}

/// A slot or an output, and its topic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PortCharge {
    /// Name of the slot or output.
    pub name: String,
    /// The topic.
    pub topic: String,
    /// What it carries, such as `yamabico.Odometry.v1`.
    pub message: String,
}

/// What a device is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceCharge {
    /// Which of the program's drivers.
    pub driver: String,
    /// What to open.
    pub spec: DeviceSpec,
    /// What its sensors publish.
    pub outputs: Vec<PortCharge>,
    /// Seconds that the drive takes to stand from its largest speed.
    pub stops_in_s: f64,
    /// Where its clock counts: one step of it, milliseconds, unless it knows better.
    pub step_ms: f64,
}

/// A charge that does not fit the program.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChargeError {
    /// Another version of the protocol.
    #[error("the charge is of protocol {told}, this program knows {PROTOCOL}: build both from one version")]
    Protocol {
        /// That of the charge.
        told: u32,
    },
    /// The program has no such part.
    #[error("this program has no {what} `{name}`")]
    NoSuchPart {
        /// `behavior` or `driver`.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// A port is of a type that the program does not know.
    #[error("`{port}`: {problem}: build both from one version")]
    Message {
        /// The slot or output.
        port: String,
        /// What is wrong.
        problem: String,
    },
}

impl BehaviorCharge {
    /// That of `plan`.
    pub fn of(plan: &BehaviorPlan) -> BehaviorCharge {
        let setup = &plan.setup;
        let sensor =
            |slot: &str| setup.sensors.iter().find(|(name, _)| name == slot).map(|(_, info)| info.clone());
        let inputs = plan.inputs.iter().map(|(slot, topic, message)| InputCharge {
            port: port(slot, topic, message),
            sensor: sensor(slot),
        });
        let info = plan.factory.info();
        let outputs = info.outputs.iter();
        BehaviorCharge {
            plugin: info.name.clone(),
            priority: plan.priority,
            proposal: topics::proposal(&setup.name),
            period_ms: plan.period.map(milliseconds),
            budget_ms: plan.budget.map(milliseconds),
            sleeps_while_inhibited: plan.sleeps,
            folder: setup.folder.clone(),
            parameters: plan.table.clone(),
            robot: setup.robot.clone(),
            inputs: inputs.collect(),
            outputs: outputs
                .map(|slot| port(&slot.name, &topics::output(&setup.name, &slot.name), &slot.message))
                .collect(),
        }
    }

    /// The plan of the behavior `name` that it charges one of `plugins` with.
    ///
    /// # Errors
    /// No such behavior, or a message of another version.
    pub fn plan(self, name: &str, plugins: &Plugins, hosting: Hosting) -> Result<BehaviorPlan, ChargeError> {
        let factory = plugins.behavior(&self.plugin);
        let factory =
            factory.ok_or_else(|| ChargeError::NoSuchPart { what: "behavior", name: self.plugin.clone() })?;
        let inputs = self.inputs.iter().map(|input| {
            let PortCharge { name, topic, .. } = &input.port;
            Ok((name.clone(), topic.clone(), input.port.carries()?))
        });
        let inputs = inputs.collect::<Result<_, ChargeError>>()?;
        self.outputs.iter().try_for_each(|output| output.carries().map(|_| ()))?;
        let sensors = self.inputs.into_iter().filter_map(|input| Some((input.port.name, input.sensor?)));
        Ok(BehaviorPlan {
            factory: Arc::clone(factory),
            table: self.parameters,
            setup: Setup {
                name: name.to_owned(),
                robot: self.robot,
                folder: self.folder,
                sensors: sensors.collect(),
            },
            priority: self.priority,
            inputs,
            period: self.period_ms.map(duration),
            budget: self.budget_ms.map(duration),
            sleeps: self.sleeps_while_inhibited,
            hosting,
            exec: Vec::new(),
        })
    }
}

impl DeviceCharge {
    /// That of `plan`, in a run with steps that are so long.
    pub fn of(plan: &DevicePlan, step: Duration) -> DeviceCharge {
        let limits = &plan.spec.robot.limits;
        let axes = limits.speed.iter().zip(&limits.emergency);
        let stops_in_s = axes.map(|(speed, emergency)| speed / emergency).filter(|time| time.is_finite());
        DeviceCharge {
            driver: plan.driver.info().name.clone(),
            spec: plan.spec.clone(),
            outputs: plan
                .sensors
                .iter()
                .map(|(name, message)| port(name, &topics::sensor(name), message))
                .collect(),
            stops_in_s: stops_in_s.fold(0.0, f64::max),
            step_ms: milliseconds(step),
        }
    }

    /// The plan of the device that it charges one of `drivers` with.
    ///
    /// # Errors
    /// No such driver, or a message of another version.
    pub fn plan(self, plugins: &Plugins, hosting: Hosting) -> Result<DevicePlan, ChargeError> {
        let driver = plugins.driver(&self.driver);
        let driver =
            driver.ok_or_else(|| ChargeError::NoSuchPart { what: "driver", name: self.driver.clone() })?;
        let sensors = self.outputs.iter().map(|output| Ok((output.name.clone(), output.carries()?)));
        Ok(DevicePlan {
            driver: Arc::clone(driver),
            sensors: sensors.collect::<Result<_, _>>()?,
            spec: self.spec,
            hosting,
            exec: Vec::new(),
        })
    }
}

impl Charge {
    /// Refuses what this program does not understand.
    ///
    /// # Errors
    /// Another version of the protocol.
    pub fn check(&self) -> Result<(), ChargeError> {
        if self.protocol == PROTOCOL { Ok(()) } else { Err(ChargeError::Protocol { told: self.protocol }) }
    }

    /// Where it runs: here.
    pub fn hosting(&self) -> Hosting {
        Hosting {
            isolation: Isolation::Process,
            patience: duration(4.0 * self.beat_ms),
            // The process has it since it was started.
            scheduling: Scheduling::default(),
        }
    }
}

impl PortCharge {
    fn carries(&self) -> Result<MessageType, ChargeError> {
        MessageType::find(&self.message).copied().ok_or_else(|| ChargeError::Message {
            port: self.name.clone(),
            problem: MessageType::unknown(&self.message),
        })
    }
}

fn port(name: &str, topic: &str, message: &MessageType) -> PortCharge {
    PortCharge { name: name.to_owned(), topic: topic.to_owned(), message: message.name.to_owned() }
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

fn duration(milliseconds: f64) -> Duration {
    Duration::try_from_secs_f64(milliseconds * 1e-3).unwrap_or_default()
}
