//! Modes of the drive.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;

/// Mode of the drive. Times are in seconds, poses by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) enum Mode {
    /// Other behaviors drive: the path is free.
    #[default]
    Free,
    /// Drives the best lane.
    Lane,
    /// Stands: something that moves crosses the way.
    Yield { since_s: f64 },
    /// Stands: no lane is free, or a sonar sees something within its gate.
    Wait { since_s: f64 },
    /// Backs off the way it came.
    Back { since_s: f64 },
    /// Turns in place to the side with more room.
    Turn { since_s: f64, side: f64 },
    /// Turns in place to the first leg of a route: its heading by odometry, rad, and its length, m.
    Face { since_s: f64, heading: f64, length_m: f64 },
    /// Drives a short way straight ahead.
    Out { since_s: f64, from: Pose2, length_m: f64 },
}
