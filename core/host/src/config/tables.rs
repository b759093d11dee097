//! The keys that every task file and every robot file has, as they are written; units as in the file.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::Scheduling;

/// Top of a task file.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with their places")]
pub(crate) struct TaskKeys {
    /// The robot file, relative to this file.
    #[schemars(required)]
    pub robot: Option<String>,
    /// When the run ends.
    #[serde(default)]
    pub run: RunKeys,
    /// How proposals become a command.
    #[serde(default)]
    pub arbiter: ArbiterKeys,
    /// The behaviors by name.
    #[schemars(required)]
    pub behaviors: Option<BTreeMap<String, Keys>>,
    /// Wires: while one behavior is active, another is not heard at all.
    #[serde(default)]
    pub inhibit: Vec<WireKeys>,
    /// Wires: while one behavior is active, another is not heard on the axes that the first claims.
    #[serde(default)]
    pub suppress: Vec<WireKeys>,
}

/// Keys that depend on a plugin.
pub(crate) type Keys = serde_json::Map<String, serde_json::Value>;

/// When a run ends.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct RunKeys {
    /// Longest time of the run; without it, until the goal is reached or the sensors have ended.
    #[schemars(range(min = 0.001, max = 1e6))]
    pub duration_s: Option<f64>,
    /// Where to arrive; without it, the run ends with its time or its sensors.
    pub goal: Option<GoalKeys>,
    /// Simulated time of one step; without it, one period of the arbiter.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub step_ms: Option<f64>,
}

/// A place to arrive at, in the frame of the map.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct GoalKeys {
    /// Along the map's x axis.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub x_m: f64,
    /// Along the map's y axis.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub y_m: f64,
    /// How near is there.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub tolerance_m: f64,
}

/// How proposals become a command.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct ArbiterKeys {
    /// Commands a second, at the least.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub rate_hz: f64,
    /// Who gets an axis: the highest priority, or a mean by confidence among equal priorities.
    pub policy: Policy,
    /// A proposal is refused when the instant that it describes is longer ago.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: f64,
    /// A proposal is refused when the oldest sensor data in it is older.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_evidence_age_ms: f64,
    /// A command that rests on older sensor data is late, which is counted and reported; without it, none is.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub latency_budget_ms: Option<f64>,
    /// Whether late commands slow the robot: to the share of its largest speeds that the budget has in the data's age.
    pub latency_slows: bool,
    /// What is asked of the system's scheduler for the arbiter.
    pub scheduling: SchedulingKeys,
}

impl Default for ArbiterKeys {
    fn default() -> Self {
        ArbiterKeys {
            rate_hz: 50.0,
            policy: Policy::Strict,
            max_age_ms: 200.0,
            max_evidence_age_ms: 1000.0,
            latency_budget_ms: None,
            latency_slows: false,
            scheduling: SchedulingKeys::default(),
        }
    }
}

/// Where a plugin runs while the robot runs live; in lockstep it makes no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Isolation {
    /// In a process of its own: whatever becomes of it, the others go on, and it is started again.
    #[default]
    Process,
    /// On a thread of the arbiter's process: no start-up to wait for, but a crash is everybody's.
    Thread,
}

/// What is asked of the system's scheduler while the robot runs live; what it refuses is told, and the robot runs on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(default)]
pub(crate) struct SchedulingKeys {
    /// Real-time priority (SCHED_FIFO): it goes before everything that has none, and before lower ones.
    #[schemars(range(min = 1, max = 99))]
    pub fifo: Option<u8>,
    /// Niceness: lower gets more of the processor.
    #[schemars(range(min = -20, max = 19))]
    pub nice: Option<i8>,
    /// The processors that it may run on, by number; without it, all.
    #[schemars(length(min = 1), inner(range(min = 0, max = 127)))]
    pub affinity: Option<Vec<u8>>,
}

impl SchedulingKeys {
    pub fn scheduling(&self) -> Scheduling {
        let numbers = self.affinity.iter().flatten().filter(|number| **number < 128);
        Scheduling {
            fifo: self.fifo,
            nice: self.nice,
            processors: numbers.fold(0, |all, number| all | 1 << number),
        }
    }
}

/// Whose clock counts while a robot runs live.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// The machine's.
    #[default]
    Machine,
    /// That of the only device, a program of its own: time advances by what it says, and waits for everybody.
    Driver,
}

/// Who gets an axis that several behaviors claim.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Policy {
    /// The highest priority; equal priorities are a mistake.
    #[default]
    Strict,
    /// Among equal priorities the mean, weighted by confidence.
    Blend,
}

/// The keys that every behavior has, beside its own.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(extend("required" = ["priority"]))]
pub(crate) struct BehaviorKeys {
    /// Which behavior; without it, the one that the table is named after.
    #[serde(rename = "type")]
    pub kind: Option<String>,
    /// Who wins an axis; higher wins.
    #[schemars(range(min = -1_000_000, max = 1_000_000))]
    pub priority: Option<i32>,
    /// Whether its silence stops the robot.
    pub critical: bool,
    /// Whether it takes part from the start.
    pub enabled: bool,
    /// What is plugged into each of its inputs: the name of a sensor, or "behavior.output".
    pub inputs: BTreeMap<String, String>,
    /// It is asked at least this often; without it, on new input only.
    #[schemars(range(min = 0.1, max = 60000.0))]
    pub period_ms: Option<f64>,
    /// Longest silence before it counts as dead; without it, three periods. A process of it that hangs has ended by then.
    #[schemars(range(min = 0.1, max = 60000.0))]
    pub deadline_ms: Option<f64>,
    /// Computing time that one proposal may take; a longer one is counted and reported.
    #[schemars(range(min = 0.001, max = 60000.0))]
    pub budget_ms: Option<f64>,
    /// Its proposals are refused when the instant that they describe is longer ago; without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: Option<f64>,
    /// Its proposals are refused when the oldest sensor data in them is older; without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_evidence_age_ms: Option<f64>,
    /// A command of it that rests on older sensor data is late; without it, the arbiter's.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub latency_budget_ms: Option<f64>,
    /// A halt or limit of it lasts at least this long.
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub hold_ms: f64,
    /// It keeps an axis this long before a lower priority gets it.
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub dwell_ms: f64,
    /// Where it runs while the robot runs live.
    pub isolation: Isolation,
    /// What is asked of the system's scheduler for it.
    pub scheduling: SchedulingKeys,
    /// Whether it is not asked while another behavior inhibits it; it then begins with the newest input.
    pub sleeps_while_inhibited: bool,
    /// The program that it is, and its arguments, where it is no part of this one. The program's path is relative to this file,
    /// and so is an argument that begins with `./` or `../`.
    #[schemars(length(min = 1))]
    pub exec: Option<Vec<String>>,
}

impl Default for BehaviorKeys {
    fn default() -> Self {
        BehaviorKeys {
            kind: None,
            priority: None,
            critical: false,
            enabled: true,
            inputs: BTreeMap::new(),
            period_ms: None,
            deadline_ms: None,
            budget_ms: None,
            max_age_ms: None,
            max_evidence_age_ms: None,
            latency_budget_ms: None,
            hold_ms: 500.0,
            dwell_ms: 0.0,
            isolation: Isolation::default(),
            scheduling: SchedulingKeys::default(),
            sleeps_while_inhibited: false,
            exec: None,
        }
    }
}

/// One behavior silences another.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with their places")]
pub(crate) struct WireKeys {
    /// The behavior that silences while it is active.
    pub by: String,
    /// The behavior that is silenced.
    pub what: String,
    /// How long after that it stays silenced.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3_600_000.0))]
    pub hold_ms: f64,
}

/// Top of a robot file.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with their places")]
pub(crate) struct RobotKeys {
    /// Name of the robot.
    #[schemars(required)]
    pub name: Option<String>,
    /// Whose clock counts while the robot runs live.
    #[serde(default)]
    pub clock: Clock,
    /// The room that the robot takes.
    #[schemars(required)]
    pub footprint: Option<FootprintKeys>,
    /// What the drive can do.
    #[serde(default)]
    pub limits: LimitsKeys,
    /// The devices by name.
    #[schemars(required)]
    pub devices: Option<BTreeMap<String, Keys>>,
    /// The sensors by name.
    #[serde(default)]
    pub sensors: BTreeMap<String, Keys>,
    /// What moves the robot.
    #[schemars(required)]
    pub drive: Option<Keys>,
}

/// The room that the robot takes.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct FootprintKeys {
    /// Of the circle about the center that holds the whole robot.
    #[schemars(required, range(min = 0.01, max = 10.0))]
    pub radius_m: Option<f64>,
}

/// What the drive can do.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct LimitsKeys {
    /// Largest speed forward and backward.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub max_linear_mps: f64,
    /// Largest speed sideways; without it, the forward one where the drive moves sideways.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub max_lateral_mps: Option<f64>,
    /// Largest turn rate.
    #[schemars(range(min = 0.001, max = 20.0))]
    pub max_angular_radps: f64,
    /// Largest acceleration forward.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_acceleration_mps2: f64,
    /// Largest acceleration sideways; without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_acceleration_mps2: Option<f64>,
    /// Largest acceleration of a turn.
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_acceleration_radps2: f64,
    /// Largest deceleration forward in normal driving.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_deceleration_mps2: f64,
    /// Largest deceleration sideways in normal driving; without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_deceleration_mps2: Option<f64>,
    /// Largest deceleration of a turn in normal driving.
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_deceleration_radps2: f64,
    /// Deceleration of a halt, forward.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub linear_emergency_mps2: f64,
    /// Deceleration of a halt, sideways; without it, the forward one.
    #[schemars(range(min = 0.01, max = 50.0))]
    pub lateral_emergency_mps2: Option<f64>,
    /// Deceleration of a halt, of a turn.
    #[schemars(range(min = 0.01, max = 500.0))]
    pub angular_emergency_radps2: f64,
    /// Largest change of acceleration, forward.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub linear_jerk_mps3: f64,
    /// Largest change of acceleration, sideways; without it, the forward one.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub lateral_jerk_mps3: Option<f64>,
    /// Largest change of acceleration of a turn.
    #[schemars(range(min = 0.1, max = 10000.0))]
    pub angular_jerk_radps3: f64,
}

impl Default for LimitsKeys {
    fn default() -> Self {
        let limits = yamabico_core::sensor::MotionLimits::default();
        LimitsKeys {
            max_linear_mps: limits.speed[0],
            max_lateral_mps: None,
            max_angular_radps: limits.speed[2],
            linear_acceleration_mps2: limits.acceleration[0],
            lateral_acceleration_mps2: None,
            angular_acceleration_radps2: limits.acceleration[2],
            linear_deceleration_mps2: limits.deceleration[0],
            lateral_deceleration_mps2: None,
            angular_deceleration_radps2: limits.deceleration[2],
            linear_emergency_mps2: limits.emergency[0],
            lateral_emergency_mps2: None,
            angular_emergency_radps2: limits.emergency[2],
            linear_jerk_mps3: limits.jerk[0],
            lateral_jerk_mps3: None,
            angular_jerk_radps3: limits.jerk[2],
        }
    }
}

/// The keys that every device has, beside its driver's own.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(default)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with their places")]
pub(crate) struct DeviceKeys {
    /// Which driver; without it, the one that `exec` names.
    pub driver: Option<String>,
    /// The program that it is, and its arguments, where it is no part of this one. The program's path is relative to this file,
    /// and so is an argument that begins with `./` or `../`.
    #[schemars(length(min = 1))]
    pub exec: Option<Vec<String>>,
    /// Where it runs while the robot runs live.
    pub isolation: Isolation,
    /// A process of it that is silent for so long hangs: it has been ended by then, and is started again.
    #[schemars(range(min = 50.0, max = 60000.0))]
    pub deadline_ms: f64,
    /// What is asked of the system's scheduler for it.
    pub scheduling: SchedulingKeys,
}

impl Default for DeviceKeys {
    fn default() -> Self {
        DeviceKeys {
            driver: None,
            exec: None,
            isolation: Isolation::default(),
            deadline_ms: 500.0,
            scheduling: SchedulingKeys::default(),
        }
    }
}

/// The keys that every drive has, beside its kind's own.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; some are read from the tree, with their places")]
pub(crate) struct PartKeys {
    /// The device that it belongs to.
    #[schemars(required)]
    pub device: Option<String>,
    /// Which of the kinds that the device's driver offers.
    #[schemars(required)]
    pub kind: Option<String>,
    /// Its wheels, so that none is asked to turn faster than it can; without them, `[limits]` alone bounds a motion.
    pub wheels: Option<WheelKeys>,
}

/// The wheels of a drive. A motion that asks for more than they can roll is slowed down on the same curve.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub(crate) struct WheelKeys {
    /// How many: 2 on one axle, or 3 or 4 omnidirectional ones on a circle.
    #[schemars(range(min = 2, max = 4))]
    pub count: u8,
    /// From the robot's center to where each wheel touches the floor: half the wheel base, or the radius of the circle.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub from_center_m: f64,
    /// Of each wheel.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub radius_m: f64,
    /// Largest turn rate of a wheel.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub max_radps: f64,
}

/// The keys that every sensor has, beside its kind's own.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[allow(dead_code, reason = "declared for the schema; read from the tree, with their places")]
pub(crate) struct SensorKeys {
    /// The device that it belongs to.
    #[schemars(required)]
    pub device: Option<String>,
    /// Which of the kinds that the device's driver offers.
    #[schemars(required)]
    pub kind: Option<String>,
    /// Whether the robot must not move without it.
    #[serde(default)]
    pub critical: bool,
    /// Age of its newest measurement from which on it counts as dead; without it, three periods and its latency.
    #[schemars(range(min = 1.0, max = 60000.0))]
    pub max_age_ms: Option<f64>,
}
