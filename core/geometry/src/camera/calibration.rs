//! How well the numbers of a camera are known.

use serde::{Deserialize, Serialize};

/// How well the numbers of a camera are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Calibration {
    /// Intrinsics and mount were measured: angles and distances can be trusted.
    Measured,
    /// They were guessed: directions are only roughly right, distances mean nothing.
    Guessed,
}
