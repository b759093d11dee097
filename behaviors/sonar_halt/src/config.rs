//! Parameters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// Rule by which an echo halts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GateRule {
    /// An echo on the path that the footprint sweeps, nearer than the robot needs to stop.
    SweptPath,
    /// Any echo nearer than `gate_m`.
    Range,
}

/// Parameters of [`SonarHalt`](crate::SonarHalt).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Rule by which an echo halts: `swept-path` for one on the path of the footprint, nearer than the robot needs to stop, or
    /// `range` for any echo nearer than `gate_m`.
    #[default(GateRule::SweptPath)]
    pub gate: GateRule,
    /// Range below which an echo halts the robot, measured from the sensor: with `gate = "range"`; while the robot's motion is
    /// not known, this or the stopping distance from full speed plus `margin_m`, whichever is longer.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// Clearance around the robot's circle on the swept path.
    #[default(0.08)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub margin_m: f64,
    /// Distance that remains before the margin after a stop.
    #[default(0.1)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reserve_m: f64,
    /// Time from an echo until the robot brakes.
    #[default(150.0)]
    #[schemars(range(min = 0.0, max = 2000.0))]
    pub reaction_ms: f64,
    /// Deceleration that the stopping distance counts on; at most the robot's lowest emergency deceleration of a
    /// translation is used.
    #[default(1.0)]
    #[schemars(range(min = 0.05, max = 20.0))]
    pub deceleration_mps2: f64,
    /// Time to contact below which something that comes nearer by itself halts the robot.
    #[default(1.2)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub halt_s: f64,
    /// Time to contact below which something that comes nearer by itself slows the robot.
    #[default(2.5)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub slow_s: f64,
    /// Speed limit while an obstacle approaches.
    #[default(0.2)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub slow_mps: f64,
    /// Number of consecutive clean scans that release the halt.
    #[default(3)]
    #[schemars(range(min = 1, max = 100))]
    pub clean_readings: u32,
    /// Age of the newest scan above which the robot halts.
    #[default(300.0)]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Clearance around the robot's circle that turning in place requires.
    #[default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub turning_margin_m: f64,
}
