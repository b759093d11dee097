//! Keys of task files and robot files that no plugin defines, in the units of the files.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::sensor::MotionLimits;

use crate::Scheduling;

/// Top level of a task file.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with source spans")]
pub(crate) struct TaskKeys {
    /// Path of the robot file, relative to this file.
    #[schemars(required)]
    pub robot: Option<String>,
    /// End of the run.
    #[serde(default)]
    pub run: RunKeys,
    /// Arbitration.
    #[serde(default)]
    pub arbiter: ArbiterKeys,
    /// Behaviors by name.
    #[schemars(required)]
    pub behaviors: Option<BTreeMap<String, Keys>>,
    /// Inhibition wires: while one behavior is active, drive proposals of another are ignored.
    #[serde(default)]
    pub inhibit: Vec<WireKeys>,
    /// Suppression wires: while one behavior is active, drive proposals of another are ignored on the axes that the
    /// first one claims.
    #[serde(default)]
    pub suppress: Vec<WireKeys>,
}

/// Keys defined by a plugin.
pub(crate) type Keys = serde_json::Map<String, serde_json::Value>;

/// End of a run.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct RunKeys {
    /// Maximum duration of the run. Without it, the run ends at the goal or when the sensors end.
    #[schemars(range(min = 0.001, max = 1e6))]
    pub duration_s: Option<f64>,
    /// Goal area. Without it, the run ends at its duration or when the sensors end.
    pub goal: Option<GoalKeys>,
    /// Simulated time per step. Without it, one period of the arbiter.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub step_ms: Option<f64>,
}

/// Goal area in the map frame.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct GoalKeys {
    /// Position along the map's x axis.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub x_m: f64,
    /// Position along the map's y axis.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub y_m: f64,
    /// Distance at which the goal is reached.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub tolerance_m: f64,
}

/// Arbitration.
#[derive(Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default)]
pub(crate) struct ArbiterKeys {
    /// Minimum rate of commands.
    #[default(50.0)]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub rate_hz: f64,
    /// Winner of an axis that several behaviors claim.
    pub policy: Policy,
    /// Maximum age of a proposal, from the instant that it describes.
    #[default(200.0)]
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: f64,
    /// Maximum age of the oldest sensor data in a proposal.
    #[default(1000.0)]
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_evidence_age_ms: f64,
    /// Age of sensor data above which a command counts as late and is reported. Without it, no command is late.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub latency_budget_ms: Option<f64>,
    /// If true, late commands are slowed down in proportion to the latency budget divided by the age of the data.
    pub latency_slows: bool,
    /// Scheduling of the arbiter by the operating system.
    pub scheduling: SchedulingKeys,
}

/// Placement of a plugin while the robot runs live; without effect in lockstep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Isolation {
    /// Own process: a crash does not affect the others, and the plugin is restarted.
    #[default]
    Process,
    /// Thread of the arbiter's process: starts at once, but a crash ends the process.
    Thread,
}

/// Scheduling by the operating system while the robot runs live. A refused setting is reported, and the robot runs on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(default)]
pub(crate) struct SchedulingKeys {
    /// Real-time priority (SCHED_FIFO). Without it, the default policy of the system.
    #[schemars(range(min = 1, max = 99))]
    pub fifo: Option<u8>,
    /// Niceness; a lower value gets more processor time.
    #[schemars(range(min = -20, max = 19))]
    pub nice: Option<i8>,
    /// Numbers of the allowed processors. Without it, all.
    #[schemars(length(min = 1), inner(range(min = 0, max = 127)))]
    pub affinity: Option<Vec<u8>>,
}

impl SchedulingKeys {
    /// Returns the settings for the host.
    pub fn scheduling(&self) -> Scheduling {
        let numbers = self.affinity.iter().flatten().filter(|number| **number < 128);
        Scheduling {
            fifo: self.fifo,
            nice: self.nice,
            affinity: numbers.fold(0, |all, number| all | 1 << number),
        }
    }
}

/// Source of time while a robot runs live.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// Clock of the machine.
    #[default]
    Machine,
    /// Clock of the only device, an external program: it advances time in steps and waits for all plugins.
    Driver,
}

/// Winner of an axis that several behaviors claim.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Policy {
    /// The highest priority; equal priorities are an error.
    #[default]
    Strict,
    /// The mean of equal priorities, weighted by confidence.
    Blend,
}

/// Keys common to all behaviors.
#[derive(Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default)]
#[schemars(extend("required" = ["priority"]))]
pub(crate) struct BehaviorKeys {
    /// Name of the behavior in `yamabico list`. Without it, the name of the table.
    #[serde(rename = "type")]
    pub kind: Option<String>,
    /// Priority; the highest wins an axis.
    #[schemars(range(min = -1_000_000, max = 1_000_000))]
    pub priority: Option<i32>,
    /// If true, the robot stops when the behavior is silent.
    pub critical: bool,
    /// If true, the behavior is enabled at the start.
    #[default(true)]
    pub enabled: bool,
    /// Source of each input slot: a sensor name, "behavior.output", "operator" or "arbiter".
    pub inputs: BTreeMap<String, String>,
    /// Maximum time between two calls. Without it, the behavior is called on new input only.
    #[schemars(range(min = 0.1, max = 60000.0))]
    pub period_ms: Option<f64>,
    /// Silence after which the behavior counts as dead and a hung process is killed. Without it, three periods.
    #[schemars(range(min = 0.1, max = 60000.0))]
    pub deadline_ms: Option<f64>,
    /// Computing time above which a call is counted and reported as an overrun.
    #[schemars(range(min = 0.001, max = 60000.0))]
    pub budget_ms: Option<f64>,
    /// Maximum age of a proposal, from the instant that it describes. Without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: Option<f64>,
    /// Maximum age of the oldest sensor data in a proposal. Without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_evidence_age_ms: Option<f64>,
    /// Age of sensor data above which a command from this behavior counts as late. Without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub latency_budget_ms: Option<f64>,
    /// Minimum duration of a halt or limit.
    #[default(500.0)]
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub hold_ms: f64,
    /// Time for which the behavior keeps an axis before a lower priority gets it.
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub dwell_ms: f64,
    /// Placement of the behavior while the robot runs live.
    pub isolation: Isolation,
    /// Scheduling of the behavior by the operating system.
    pub scheduling: SchedulingKeys,
    /// If true, the behavior is not called while it is inhibited, and resumes with the newest input.
    pub sleeps_while_inhibited: bool,
    /// External program of the behavior, and its arguments. The path of the program, and arguments that begin with `./`
    /// or `../`, are relative to this file.
    #[schemars(length(min = 1))]
    pub exec: Option<Vec<String>>,
}

/// Wire from one behavior onto another.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with source spans")]
pub(crate) struct WireKeys {
    /// Behavior that silences the other while it is active.
    pub by: String,
    /// Silenced behavior.
    pub what: String,
    /// Time for which it stays silenced afterwards.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub hold_ms: f64,
}

/// Top level of a robot file.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with source spans")]
pub(crate) struct RobotKeys {
    /// Paths of files with further tables of this robot file, relative to this file. No key may be set twice.
    #[serde(default)]
    #[schemars(length(max = 20))]
    pub include: Vec<String>,
    /// Name of the robot.
    #[schemars(required)]
    pub name: Option<String>,
    /// Source of time while the robot runs live.
    #[serde(default)]
    pub clock: Clock,
    /// Footprint of the robot.
    #[schemars(required)]
    pub footprint: Option<FootprintKeys>,
    /// Limits of the drive.
    #[serde(default)]
    pub limits: LimitsKeys,
    /// Devices by name.
    #[schemars(required)]
    pub devices: Option<BTreeMap<String, Keys>>,
    /// Sensors by name.
    #[serde(default)]
    pub sensors: BTreeMap<String, Keys>,
    /// Drive that moves the robot.
    #[schemars(required)]
    pub drive: Option<Keys>,
}

/// Footprint of the robot.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct FootprintKeys {
    /// Radius of the circle around the robot's center that encloses the robot.
    #[schemars(required, range(min = 0.01, max = 10.0))]
    pub radius_m: Option<f64>,
}

/// Limits of the drive.
#[derive(Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default)]
pub(crate) struct LimitsKeys {
    /// Maximum forward and backward speed.
    #[default(MotionLimits::default().speed[0])]
    #[schemars(range(min = 0.001, max = 10.0))]
    pub max_linear_mps: f64,
    /// Maximum sideways speed. Without it, the forward speed if the drive moves sideways.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub max_lateral_mps: Option<f64>,
    /// Maximum turn rate.
    #[default(MotionLimits::default().speed[2])]
    #[schemars(range(min = 0.001, max = 20.0))]
    pub max_angular_radps: f64,
    /// Maximum forward acceleration.
    #[default(MotionLimits::default().acceleration[0])]
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_acceleration_mps2: f64,
    /// Maximum sideways acceleration. Without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_acceleration_mps2: Option<f64>,
    /// Maximum angular acceleration.
    #[default(MotionLimits::default().acceleration[2])]
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_acceleration_radps2: f64,
    /// Maximum forward deceleration in normal driving.
    #[default(MotionLimits::default().deceleration[0])]
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_deceleration_mps2: f64,
    /// Maximum sideways deceleration in normal driving. Without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_deceleration_mps2: Option<f64>,
    /// Maximum angular deceleration in normal driving.
    #[default(MotionLimits::default().deceleration[2])]
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_deceleration_radps2: f64,
    /// Forward deceleration of a halt.
    #[default(MotionLimits::default().emergency[0])]
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_emergency_mps2: f64,
    /// Sideways deceleration of a halt. Without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_emergency_mps2: Option<f64>,
    /// Angular deceleration of a halt.
    #[default(MotionLimits::default().emergency[2])]
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_emergency_radps2: f64,
    /// Maximum forward jerk.
    #[default(MotionLimits::default().jerk[0])]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub linear_jerk_mps3: f64,
    /// Maximum sideways jerk. Without it, the forward one.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub lateral_jerk_mps3: Option<f64>,
    /// Maximum angular jerk.
    #[default(MotionLimits::default().jerk[2])]
    #[schemars(range(min = 0.1, max = 10000.0))]
    pub angular_jerk_radps3: f64,
}

/// Keys common to all devices.
#[derive(Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with source spans")]
pub(crate) struct DeviceKeys {
    /// Name of the driver in `yamabico list`. Without it, the program in `exec`.
    pub driver: Option<String>,
    /// External program of the device, and its arguments. The path of the program, and arguments that begin with `./`
    /// or `../`, are relative to this file.
    #[schemars(length(min = 1))]
    pub exec: Option<Vec<String>>,
    /// Placement of the device while the robot runs live.
    pub isolation: Isolation,
    /// Silence after which a process of the device counts as hung, is killed and restarted.
    #[default(500.0)]
    #[schemars(range(min = 50.0, max = 60000.0))]
    pub deadline_ms: f64,
    /// Scheduling of the device by the operating system.
    pub scheduling: SchedulingKeys,
}

/// Keys common to all drives.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with source spans")]
pub(crate) struct PartKeys {
    /// Name of the device.
    #[schemars(required)]
    pub device: Option<String>,
    /// Kind of drive, one that the device's driver offers.
    #[schemars(required)]
    pub kind: Option<String>,
    /// Wheels, so that no command exceeds their speed. Without them, only `[limits]` bounds the motion.
    pub wheels: Option<WheelKeys>,
}

/// Wheels of a drive. A motion that exceeds their speed is slowed down on the same curve.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct WheelKeys {
    /// Number of wheels: 2 on one axle, or 3 or 4 omnidirectional ones on a circle.
    #[schemars(range(min = 2, max = 4))]
    pub count: u8,
    /// Distance from the robot's center to the contact point of each wheel: half the wheelbase, or the radius of the
    /// circle.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub from_center_m: f64,
    /// Radius of each wheel.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub radius_m: f64,
    /// Maximum angular velocity of a wheel.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub max_radps: f64,
}

/// Keys common to all sensors.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; read from the tree, with source spans")]
pub(crate) struct SensorKeys {
    /// Name of the device.
    #[schemars(required)]
    pub device: Option<String>,
    /// Kind of sensor, one that the device's driver offers.
    #[schemars(required)]
    pub kind: Option<String>,
    /// If true, the robot stops without this sensor.
    #[serde(default)]
    pub critical: bool,
    /// Age of its newest measurement above which the sensor counts as dead. Without it, three periods plus its latency.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: Option<f64>,
}
