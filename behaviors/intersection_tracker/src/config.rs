//! The parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;

/// Parameters of [`IntersectionTracker`](crate::IntersectionTracker).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Speed towards the intersection, m/s, 0.02 to 2, default 0.4.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Turn rate per angle to the middle of the intersection, 1/s, 0.1 to 4, default 1.2.
    #[schemars(range(min = 0.1, max = 4.0))]
    pub turn_gain: f64,
    /// Largest turn rate, rad/s, 0.1 to 3, default 0.6.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub largest_turn_radps: f64,
    /// Nearer than this it hands over, m, 0.5 to 5, default 1.2.
    #[schemars(range(min = 0.5, max = 5.0))]
    pub nearest_m: f64,
    /// Farther than this it looks for no intersection, m, 2 to 30, default 12.
    #[schemars(range(min = 2.0, max = 30.0))]
    pub farthest_m: f64,
    /// It hands over too when an edge comes so near to the border of the picture, pixels, 1 to 100, default 15.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub border_px: f64,
    /// Two wall ends that differ by less along the corridor are a pair, m, 0.05 to 2, default 0.3.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub pair_m: f64,
    /// So many pictures must show both ends before it steers, 1 to 20, default 3.
    #[schemars(range(min = 1, max = 20))]
    pub confirm_pictures: u32,
    /// Least correlation of a match, 0.3 to 0.99, default 0.7.
    #[schemars(range(min = 0.3, max = 0.99))]
    pub min_correlation: f64,
    /// An edge missed so often in a row is looked for anew, pictures, 1 to 20, default 3.
    #[schemars(range(min = 1, max = 20))]
    pub reacquire_misses: u32,
    /// An edge missed so often in a row is lost, pictures, 2 to 100, default 10.
    #[schemars(range(min = 2, max = 100))]
    pub lost_misses: u32,
    /// How well the mount's tilt and roll hold while driving, degrees, 0.05 to 30, default 1.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub horizon_sigma_deg: f64,
    /// Least difference of brightness across a floor line, gray levels, 1 to 100, default 8.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub floor_contrast: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            speed_mps: 0.4,
            turn_gain: 1.2,
            largest_turn_radps: 0.6,
            nearest_m: 1.2,
            farthest_m: 12.0,
            border_px: 15.0,
            pair_m: 0.3,
            confirm_pictures: 3,
            min_correlation: 0.7,
            reacquire_misses: 3,
            lost_misses: 10,
            horizon_sigma_deg: 1.0,
            floor_contrast: 8.0,
        }
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
            ("turn_gain", self.turn_gain, 0.1, 4.0),
            ("largest_turn_radps", self.largest_turn_radps, 0.1, 3.0),
            ("nearest_m", self.nearest_m, 0.5, 5.0),
            ("farthest_m", self.farthest_m, self.nearest_m + 0.5, 30.0),
            ("border_px", self.border_px, 1.0, 100.0),
            ("pair_m", self.pair_m, 0.05, 2.0),
            ("confirm_pictures", f64::from(self.confirm_pictures), 1.0, 20.0),
            ("min_correlation", self.min_correlation, 0.3, 0.99),
            ("reacquire_misses", f64::from(self.reacquire_misses), 1.0, 20.0),
            ("lost_misses", f64::from(self.lost_misses), f64::from(self.reacquire_misses) + 1.0, 100.0),
            ("horizon_sigma_deg", self.horizon_sigma_deg, 0.05, 30.0),
            ("floor_contrast", self.floor_contrast, 1.0, 100.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(BuildError::new(key, format!("{value} is not between {low} and {high}")));
            }
        }
        Ok(())
    }
}
