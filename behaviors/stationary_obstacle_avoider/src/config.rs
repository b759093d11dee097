//! The parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;

/// Parameters of [`StationaryObstacleAvoider`](crate::StationaryObstacleAvoider).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The map file, relative to the task file.
    #[schemars(extend("format" = "file"))]
    pub map: String,
    /// The table of thresholds, relative to the task file. Default none: nothing is seen, and the robot creeps.
    #[serde(default)]
    #[schemars(extend("format" = "file"))]
    pub thresholds: Option<String>,
    /// Speed while avoiding, m/s, 0.02 to 1, default 0.25.
    #[serde(default = "speed_mps")]
    #[schemars(range(min = 0.02, max = 1.0))]
    pub speed_mps: f64,
    /// Speed that is allowed while vision tells nothing, m/s, 0.01 to 1, default 0.1.
    #[serde(default = "blind_speed_mps")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub blind_speed_mps: f64,
    /// Largest turn rate, rad/s, 0.1 to 3, default 0.7.
    #[serde(default = "largest_turn_radps")]
    #[schemars(range(min = 0.1, max = 3.0))]
    pub largest_turn_radps: f64,
    /// Room that is kept beside the robot, m, 0 to 1, default 0.03.
    #[serde(default = "margin_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub margin_m: f64,
    /// Further room where a gap has it, m, 0 to 1, default 0.1: what the sonar's gate needs to stay silent.
    #[serde(default = "gap_margin_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gap_margin_m: f64,
    /// An echo nearer than this halts, m from the sensor, 0.05 to 5, default 0.5.
    #[serde(default = "gate_m")]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// A sonar silent for longer counts as an echo, ms, 20 to 2000, default 300.
    #[serde(default = "stale_ms")]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Way along the path after which an obstacle left behind is passed, m, 0.1 to 10, default 0.5.
    #[serde(default = "passing_m")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub passing_m: f64,
    /// Time after which a blocked robot looks again, s, 1 to 600, default 10.
    #[serde(default = "retry_s")]
    #[schemars(range(min = 1.0, max = 600.0))]
    pub retry_s: f64,
    /// Share by which a learned difference of edges may be exceeded, 0 to 5, default 0.5.
    #[serde(default = "epsilon")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub epsilon: f64,
}

fn speed_mps() -> f64 {
    0.25
}
fn blind_speed_mps() -> f64 {
    0.1
}
fn largest_turn_radps() -> f64 {
    0.7
}
fn margin_m() -> f64 {
    0.03
}
fn gap_margin_m() -> f64 {
    0.1
}
fn gate_m() -> f64 {
    0.5
}
fn stale_ms() -> f64 {
    300.0
}
fn passing_m() -> f64 {
    0.5
}
fn retry_s() -> f64 {
    10.0
}
fn epsilon() -> f64 {
    0.5
}

impl Config {
    /// Whether every number is in its range.
    ///
    /// # Errors
    /// The first key that is not, with its range.
    pub fn check(&self) -> Result<(), BuildError> {
        for (key, value, low, high) in [
            ("speed_mps", self.speed_mps, 0.02, 1.0),
            ("blind_speed_mps", self.blind_speed_mps, 0.01, 1.0),
            ("largest_turn_radps", self.largest_turn_radps, 0.1, 3.0),
            ("margin_m", self.margin_m, 0.0, 1.0),
            ("gap_margin_m", self.gap_margin_m, 0.0, 1.0),
            ("gate_m", self.gate_m, 0.05, 5.0),
            ("stale_ms", self.stale_ms, 20.0, 2000.0),
            ("passing_m", self.passing_m, 0.1, 10.0),
            ("retry_s", self.retry_s, 1.0, 600.0),
            ("epsilon", self.epsilon, 0.0, 5.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(BuildError::new(key, format!("{value} is not between {low} and {high}")));
            }
        }
        Ok(())
    }
}
