//! Parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::ParameterError;

/// Minimum length of the range of distances in which intersections are tracked, m.
const MIN_TRACKED_M: f64 = 0.5;

/// Parameters of [`IntersectionTracker`](crate::IntersectionTracker).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Speed toward the intersection.
    #[default(0.4)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Turn rate per angle to the middle of the intersection, 1/s.
    #[default(1.2)]
    #[schemars(range(min = 0.1, max = 4.0))]
    pub turn_gain: f64,
    /// Maximum turn rate.
    #[default(0.6)]
    #[schemars(range(min = 0.1, max = 3.0), extend("former_name" = "largest_turn_radps"))]
    pub max_turn_radps: f64,
    /// Distance at which the behavior stops steering and hands over.
    #[default(1.2)]
    #[schemars(range(min = 0.5, max = 5.0), extend("former_name" = "nearest_m"))]
    pub handover_m: f64,
    /// Maximum distance at which intersections are detected.
    #[default(12.0)]
    #[schemars(range(min = 2.0, max = 30.0), extend("former_name" = "farthest_m"))]
    pub max_range_m: f64,
    /// Distance between an edge and the border of the image below which the behavior hands over as well.
    #[default(15.0)]
    #[schemars(range(min = 1.0, max = 100.0))]
    pub border_px: f64,
    /// Maximum difference along the corridor between the two wall ends of a pair.
    #[default(0.3)]
    #[schemars(range(min = 0.05, max = 2.0))]
    pub pair_m: f64,
    /// Number of frames that must show both wall ends before the behavior steers.
    #[default(3)]
    #[schemars(range(min = 1, max = 20))]
    pub confirm_frames: u32,
    /// Minimum correlation of a template match.
    #[default(0.7)]
    #[schemars(range(min = 0.3, max = 0.99))]
    pub min_correlation: f64,
    /// Number of consecutive frames without a match after which an edge is detected anew.
    #[default(3)]
    #[schemars(range(min = 1, max = 20))]
    pub reacquire_misses: u32,
    /// Number of consecutive frames without a match after which an edge is lost.
    #[default(10)]
    #[schemars(range(min = 2, max = 100))]
    pub lost_misses: u32,
    /// Standard deviation of the camera's tilt and roll while driving.
    #[default(1.0)]
    #[schemars(range(min = 0.05, max = 30.0))]
    pub horizon_sigma_deg: f64,
    /// Minimum contrast across a floor line, gray levels.
    #[default(8.0)]
    #[schemars(range(min = 1.0, max = 100.0))]
    pub floor_contrast: f64,
}

impl Config {
    /// Checks the parameters against each other.
    ///
    /// # Errors
    /// The key to change.
    pub fn check(&self) -> Result<(), ParameterError> {
        let min_m = self.handover_m + MIN_TRACKED_M;
        if self.max_range_m < min_m {
            let problem = format!(
                "must be at least handover_m + {MIN_TRACKED_M} m = {min_m} m, but is {} m: raise it",
                self.max_range_m
            );
            return Err(ParameterError::new("max_range_m", problem));
        }
        if self.lost_misses <= self.reacquire_misses {
            let problem = format!(
                "must be more than reacquire_misses, {}, but is {}: raise it",
                self.reacquire_misses, self.lost_misses
            );
            return Err(ParameterError::new("lost_misses", problem));
        }
        Ok(())
    }
}
