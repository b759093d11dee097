//! The parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;

/// Parameters of [`WallFollower`](crate::WallFollower).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Cruising speed, m/s, 0.02 to 2, default 0.4.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Length over which an offset from the middle decays, m, 0.2 to 5, default 0.8.
    #[schemars(range(min = 0.2, max = 5.0))]
    pub convergence_m: f64,
    /// Damping of the centering law, 0.5 to 2, default 1 (critical).
    #[schemars(range(min = 0.5, max = 2.0))]
    pub damping: f64,
    /// Offsets beyond this steer no harder, m, 0.1 to 2, default 0.6.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub largest_offset_m: f64,
    /// Largest turn rate, rad/s, 0.1 to 3, default 0.8.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub largest_turn_radps: f64,
    /// Distance kept from a single wall of a corridor whose width is not known, m, 0.2 to 3, default 0.6.
    #[schemars(range(min = 0.2, max = 3.0))]
    pub single_wall_m: f64,
    /// Clearance of the robot's circle from a wall below which it steers away, m, 0 to 1, default 0.15.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub near_wall_m: f64,
    /// Clearance below which it stops and turns away in place, m, 0 to 1, default 0.05.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stop_wall_m: f64,
    /// How well the mount's tilt and roll hold while driving, degrees, 0.05 to 30, default 1.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub horizon_sigma_deg: f64,
    /// Least difference of brightness across a floor line, gray levels, 1 to 100, default 8.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub floor_contrast: f64,
    /// What to do where no vanishing point is found.
    pub lost: Lost,
}

/// What to do where no vanishing point is found.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lost {
    /// Longest drive on at half speed, s, 0 to 1, default 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub coast_s: f64,
    /// Farthest drive on at half speed, m, 0 to 2, default 0.5.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub coast_m: f64,
    /// Farthest turn to either side while searching, degrees, 0 (no search) to 90, default 30.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub search_deg: f64,
    /// Turn between two looks, degrees, 2 to 45, default 10.
    #[schemars(range(min = 2.0, max = 45.0))]
    pub step_deg: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            speed_mps: 0.4,
            convergence_m: 0.8,
            damping: 1.0,
            largest_offset_m: 0.6,
            largest_turn_radps: 0.8,
            single_wall_m: 0.6,
            near_wall_m: 0.15,
            stop_wall_m: 0.05,
            horizon_sigma_deg: 1.0,
            floor_contrast: 8.0,
            lost: Lost::default(),
        }
    }
}

impl Default for Lost {
    fn default() -> Self {
        Self { coast_s: 1.0, coast_m: 0.5, search_deg: 30.0, step_deg: 10.0 }
    }
}

impl Config {
    /// Whether every number is in its range.
    ///
    /// # Errors
    /// The first key that is not, with its range.
    pub fn check(&self) -> Result<(), BuildError> {
        for (key, value, low, high) in [
            ("speed_mps", self.speed_mps, 0.02, 2.0),
            ("convergence_m", self.convergence_m, 0.2, 5.0),
            ("damping", self.damping, 0.5, 2.0),
            ("largest_offset_m", self.largest_offset_m, 0.1, 2.0),
            ("largest_turn_radps", self.largest_turn_radps, 0.1, 3.0),
            ("single_wall_m", self.single_wall_m, 0.2, 3.0),
            ("near_wall_m", self.near_wall_m, 0.0, 1.0),
            ("stop_wall_m", self.stop_wall_m, 0.0, self.near_wall_m),
            ("horizon_sigma_deg", self.horizon_sigma_deg, 0.05, 30.0),
            ("floor_contrast", self.floor_contrast, 1.0, 100.0),
            ("lost.coast_s", self.lost.coast_s, 0.0, 1.0),
            ("lost.coast_m", self.lost.coast_m, 0.0, 2.0),
            ("lost.search_deg", self.lost.search_deg, 0.0, 90.0),
            ("lost.step_deg", self.lost.step_deg, 2.0, 45.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(BuildError::new(key, format!("{value} is not between {low} and {high}")));
            }
        }
        Ok(())
    }
}
