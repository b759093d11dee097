//! Accuracy class of a camera's parameters.

use serde::{Deserialize, Serialize};

/// Accuracy class of a camera's parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Calibration {
    /// Intrinsics and mount were measured: angles and distances are reliable.
    Measured,
    /// They were guessed: directions are approximate, distances meaningless.
    Guessed,
}
