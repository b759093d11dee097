//! Launch configuration of a plugin's process.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::config::Clock;
use crate::settings::milliseconds;
use crate::{BehaviorPlan, BehaviorSettings, DevicePlan, HostSettings, topics};
use yamabico_core::behavior::Setup;
use yamabico_core::driver::DeviceSpec;
use yamabico_core::message::MessageType;
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{Robot, SensorInfo};

/// Version of the protocol that this module describes.
pub const PROTOCOL: u32 = 2;

/// Launch configuration of a plugin, which its process reads once from standard input, as TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaunchConfig {
    /// Version of the protocol, [`PROTOCOL`].
    pub protocol: u32,
    /// Name of the plugin in the task or robot file.
    pub name: String,
    /// Name of the robot whose bus it joins.
    pub robot: String,
    /// Folder of the transport's files (iceoryx2: `global.root-path`).
    pub bus_root: PathBuf,
    /// Prefix of their names (iceoryx2: `global.prefix`).
    pub bus_prefix: String,
    /// Number of restarts of the plugin so far.
    pub restarts: u32,
    /// Longest time between two heartbeats, ms.
    pub heartbeat_ms: f64,
    /// Condition to start working.
    pub start: Start,
    /// State that the plugin's last process saved, JSON; empty if there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub saved_state: String,
    /// Request that changed the parameters during the run, ns; zero for those of the task file.
    #[serde(default)]
    pub request: u64,
    /// Clock of the run.
    #[serde(default)]
    pub clock: Clock,
    /// Role of the plugin.
    pub role: Role,
}

/// Condition for a plugin that is ready to start working.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// The first command of the arbiter: every plugin of the run starts together.
    OnFirstCommand,
    /// None: the other plugins are already running.
    Immediately,
}

/// Role of a plugin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// A behavior, which publishes proposals.
    Behavior(BehaviorLaunch),
    /// A device, which publishes measurements and obeys commands.
    Device(DeviceLaunch),
}

/// Launch configuration of a behavior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BehaviorLaunch {
    /// Name of the behavior among those of the program.
    pub plugin: String,
    /// Priority to put into its proposals.
    pub priority: i32,
    /// Topic of its proposals.
    pub proposal: String,
    /// Longest time between two calls, ms; none for calls on new input only.
    pub period_ms: Option<f64>,
    /// Computing time of one call above which it counts as an overrun, ms.
    pub budget_ms: Option<f64>,
    /// If set, it need not be called while its verdict on the topic `decision` is `inhibited`.
    #[serde(default)]
    pub sleeps_while_inhibited: bool,
    /// Folder that relative paths in its parameters refer to.
    pub folder: PathBuf,
    /// Parameters, valid under its schema.
    pub parameters: toml::Table,
    /// Description of the robot.
    pub robot: Robot,
    /// Connected slots.
    pub inputs: Vec<InputLaunch>,
    /// Outputs.
    pub outputs: Vec<PortLaunch>,
}

/// Connection of a slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InputLaunch {
    /// The slot with its topic.
    #[serde(flatten)]
    pub port: PortLaunch,
    /// Description of the sensor that publishes on the topic; none if a behavior or an operator does.
    pub sensor: Option<SensorInfo>,
}

/// Slot or output with its topic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PortLaunch {
    /// Name of the slot or output.
    pub name: String,
    /// Name of the topic.
    pub topic: String,
    /// Versioned name of the topic's message type, such as `yamabico.Odometry.v1`.
    pub message: String,
}

/// Launch configuration of a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceLaunch {
    /// Name of the driver among those of the program.
    pub driver: String,
    /// Description of the device.
    pub spec: DeviceSpec,
    /// Outputs of its sensors.
    pub outputs: Vec<PortLaunch>,
    /// Longest time that the drive needs to stop from full speed, s.
    pub stopping_time_s: f64,
    /// Default length of a step, ms, for a driver that owns the clock.
    pub step_ms: f64,
}

/// Launch configuration that does not match the program.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LaunchError {
    /// The message types of the program contradict each other.
    #[error("{0}")]
    Messages(String),
    /// The protocol has another version.
    #[error(
        "the launch configuration has version {version} of the protocol, but this program has version \
         {PROTOCOL}: build both from one version"
    )]
    Protocol {
        /// Version of the launch configuration.
        version: u32,
    },
    /// The program has no such behavior or driver.
    #[error("this program has no {kind} `{name}`")]
    NoSuchPlugin {
        /// Kind of plugin: `behavior` or `driver`.
        kind: &'static str,
        /// Requested name.
        name: String,
    },
    /// The program does not have the message type of a port.
    #[error("port `{port}`: {problem}: build both from one version")]
    Message {
        /// Name of the slot or output.
        port: String,
        /// Unknown message type, with the known versions.
        problem: String,
    },
}

impl BehaviorLaunch {
    /// Derives the launch configuration from a plan.
    pub fn of(plan: &BehaviorPlan) -> BehaviorLaunch {
        let (setup, settings) = (&plan.setup, &plan.settings);
        let sensor =
            |slot: &str| setup.sensors.iter().find(|(name, _)| name == slot).map(|(_, info)| info.clone());
        let inputs = plan.inputs.iter().map(|(slot, topic, message)| InputLaunch {
            port: port(slot, topic, message),
            sensor: sensor(slot),
        });
        let info = plan.factory.info();
        let outputs = info.outputs.iter();
        BehaviorLaunch {
            plugin: info.name.clone(),
            priority: settings.priority,
            proposal: topics::proposal(&setup.name),
            period_ms: settings.period.map(as_milliseconds),
            budget_ms: settings.budget.map(as_milliseconds),
            sleeps_while_inhibited: settings.sleeps_while_inhibited,
            folder: setup.folder.clone(),
            parameters: plan.table.clone(),
            robot: setup.robot.clone(),
            inputs: inputs.collect(),
            outputs: outputs
                .map(|slot| port(&slot.name, &topics::output(&setup.name, &slot.name), &slot.message))
                .collect(),
        }
    }

    /// Makes the plan of the behavior `name` from the program's `plugins`. The settings that the arbiter and the
    /// supervisor apply have their defaults.
    ///
    /// # Errors
    /// The program has no such behavior or message type.
    pub fn plan(self, name: &str, plugins: &Plugins) -> Result<BehaviorPlan, LaunchError> {
        let factory = plugins.behavior(&self.plugin);
        let factory = factory
            .ok_or_else(|| LaunchError::NoSuchPlugin { kind: "behavior", name: self.plugin.clone() })?;
        let inputs = self.inputs.iter().map(|input| {
            let PortLaunch { name, topic, .. } = &input.port;
            Ok((name.clone(), topic.clone(), input.port.message_type()?))
        });
        let inputs = inputs.collect::<Result<_, LaunchError>>()?;
        self.outputs.iter().try_for_each(|output| output.message_type().map(|_| ()))?;
        let connected = self.inputs.iter().map(|input| input.port.name.clone()).collect();
        let sensors = self.inputs.into_iter().filter_map(|input| Some((input.port.name, input.sensor?)));
        Ok(BehaviorPlan {
            factory: Arc::clone(factory),
            table: self.parameters,
            setup: Setup {
                name: name.to_owned(),
                robot: self.robot,
                folder: self.folder,
                sensors: sensors.collect(),
                connected: Some(connected),
            },
            inputs,
            settings: BehaviorSettings {
                priority: self.priority,
                period: self.period_ms.map(milliseconds),
                budget: self.budget_ms.map(milliseconds),
                sleeps_while_inhibited: self.sleeps_while_inhibited,
                ..BehaviorSettings::default()
            },
        })
    }
}

impl DeviceLaunch {
    /// Derives the launch configuration from a plan; `step` is the length of a step in the run.
    pub fn of(plan: &DevicePlan, step: Duration) -> DeviceLaunch {
        let limits = &plan.spec.robot.limits;
        let axes = limits.speed.iter().zip(&limits.emergency);
        let times_s = axes.map(|(speed, emergency)| speed / emergency).filter(|time| time.is_finite());
        DeviceLaunch {
            driver: plan.driver.info().name.clone(),
            spec: plan.spec.clone(),
            outputs: plan
                .sensors
                .iter()
                .map(|(name, message)| port(name, &topics::sensor(name), message))
                .collect(),
            stopping_time_s: times_s.fold(0.0, f64::max),
            step_ms: as_milliseconds(step),
        }
    }

    /// Makes the plan of the device from the program's `plugins`, with default settings.
    ///
    /// # Errors
    /// The program has no such driver or message type.
    pub fn plan(self, plugins: &Plugins) -> Result<DevicePlan, LaunchError> {
        let driver = plugins.driver(&self.driver);
        let driver =
            driver.ok_or_else(|| LaunchError::NoSuchPlugin { kind: "driver", name: self.driver.clone() })?;
        let sensors = self.outputs.iter().map(|output| Ok((output.name.clone(), output.message_type()?)));
        Ok(DevicePlan {
            driver: Arc::clone(driver),
            sensors: sensors.collect::<Result<_, _>>()?,
            spec: self.spec,
            settings: HostSettings::default(),
        })
    }
}

impl LaunchConfig {
    /// Checks the version of the protocol.
    ///
    /// # Errors
    /// [`LaunchError::Protocol`].
    pub fn check(&self) -> Result<(), LaunchError> {
        if self.protocol == PROTOCOL { Ok(()) } else { Err(LaunchError::Protocol { version: self.protocol }) }
    }
}

impl PortLaunch {
    fn message_type(&self) -> Result<MessageType, LaunchError> {
        MessageType::find(&self.message).copied().ok_or_else(|| LaunchError::Message {
            port: self.name.clone(),
            problem: MessageType::unknown(&self.message),
        })
    }
}

fn port(name: &str, topic: &str, message: &MessageType) -> PortLaunch {
    PortLaunch { name: name.to_owned(), topic: topic.to_owned(), message: message.name.to_owned() }
}

fn as_milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
