//! Parameters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// One thing to try.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// Stand, so that a person can leave.
    Wait,
    /// Stand, so that cameras see without blur and other behaviors look again.
    LookAgain,
    /// Turn in place, to the side with more room.
    Turn,
    /// Drive back along the way on which the robot came.
    BackOff,
    /// Turn to the other side, and drive ahead there if there is room.
    OtherSide,
    /// Stand and ask for help.
    Ask,
}

impl Rung {
    /// Returns the name in task files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Rung::Wait => "wait",
            Rung::LookAgain => "look-again",
            Rung::Turn => "turn",
            Rung::BackOff => "back-off",
            Rung::OtherSide => "other-side",
            Rung::Ask => "ask",
        }
    }

    /// Returns true if the motion depends at each instant on the room around the robot.
    #[must_use]
    pub const fn watches_room(self) -> bool {
        matches!(self, Rung::BackOff | Rung::OtherSide)
    }
}

/// Parameters of [`StuckRecovery`](crate::StuckRecovery).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Recovery maneuvers (rungs), tried in this order; after the last, the first again. Any of `wait`, `look-again`, `turn`,
    /// `back-off`, `other-side`
    /// and `ask`.
    #[default(vec![Rung::Wait, Rung::LookAgain, Rung::Turn, Rung::BackOff, Rung::OtherSide, Rung::Ask])]
    #[schemars(length(min = 1, max = 20))]
    pub ladder: Vec<Rung>,
    /// Time without progress after which the robot is stuck.
    #[default(12.0)]
    #[schemars(range(min = 0.5, max = 600.0), extend("former_name" = "patience_s"))]
    pub progress_timeout_s: f64,
    /// Time without progress after which the next rung is tried; at least this much of it, and of `progress_timeout_s`, must be
    /// without a halt of all axes.
    #[default(3.0)]
    #[schemars(range(min = 0.5, max = 600.0))]
    pub retry_s: f64,
    /// Minimum distance from the last position that counts as progress.
    #[default(0.15)]
    #[schemars(range(min = 0.02, max = 10.0))]
    pub progress_m: f64,
    /// Distance from the position where it was stuck after which the ladder starts again at its first rung; must be above
    /// `back_m` and `side_m`.
    #[default(1.0)]
    #[schemars(range(min = 0.05, max = 20.0))]
    pub away_m: f64,
    /// Duration of `wait`, including the time for which the robot has already stood still.
    #[default(2.0)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub wait_s: f64,
    /// Duration of `look-again`, including the time for which the robot has already stood still.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub look_s: f64,
    /// Duration of `ask`.
    #[default(5.0)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub ask_s: f64,
    /// Angle of `turn`.
    #[default(25.0)]
    #[schemars(range(min = 1.0, max = 180.0))]
    pub turn_deg: f64,
    /// Angle of `other-side` from the heading at its start.
    #[default(50.0)]
    #[schemars(range(min = 1.0, max = 180.0))]
    pub side_deg: f64,
    /// Turn rate.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 3.0))]
    pub turn_radps: f64,
    /// Distance of `back-off`.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 0.6))]
    pub back_m: f64,
    /// Distance that `other-side` drives ahead if there is that much room.
    #[default(0.4)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub side_m: f64,
    /// Speed back and ahead.
    #[default(0.15)]
    #[schemars(range(min = 0.02, max = 0.5))]
    pub speed_mps: f64,
    /// Age of odometry and decisions above which it abstains.
    #[default(300.0)]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
}
