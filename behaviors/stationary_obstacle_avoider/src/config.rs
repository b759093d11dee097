//! Parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;

/// Parameters of [`StationaryObstacleAvoider`](crate::StationaryObstacleAvoider).
#[serde_inline_default]
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Path of the map file, relative to the task file.
    #[schemars(extend("format" = "file"))]
    pub map: String,
    /// Path of the table of learned thresholds, relative to the task file. Without it the behavior detects nothing and
    /// limits the speed to `blind_speed_mps`.
    #[serde(default)]
    #[schemars(extend("format" = "file"))]
    pub thresholds: Option<String>,
    /// Speed while avoiding an obstacle.
    #[serde_inline_default(0.25)]
    #[schemars(range(min = 0.02, max = 1.0))]
    pub speed_mps: f64,
    /// Speed limit while vision gives no result.
    #[serde_inline_default(0.1)]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub blind_speed_mps: f64,
    /// Maximum turn rate.
    #[serde_inline_default(0.7)]
    #[schemars(range(min = 0.1, max = 3.0))]
    pub largest_turn_radps: f64,
    /// Clearance kept on both sides of the robot's circle.
    #[serde_inline_default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub margin_m: f64,
    /// Additional clearance in a gap that is wide enough for it, so that the sonar's gate stays clear.
    #[serde_inline_default(0.1)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gap_margin_m: f64,
    /// Range below which an echo halts the robot, measured from the sensor.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// Age of the newest scan above which the sonar counts as an echo.
    #[serde_inline_default(300.0)]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Distance driven along the path after which an obstacle behind the robot counts as passed.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub passing_m: f64,
    /// Time after which a blocked robot searches for a passage again.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 1.0, max = 600.0))]
    pub retry_s: f64,
    /// Fraction by which a difference of edges may exceed the learned one.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub epsilon: f64,
}
