//! Parameters of the behavior.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use yamabico_core::behavior::ParameterError;

/// Parameters of [`WallFollower`](crate::WallFollower).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Method of finding the corridor.
    pub method: Method,
    /// Cruising speed.
    #[default(0.4)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Distance over which a lateral offset from the centerline decays.
    #[default(0.8)]
    #[schemars(range(min = 0.2, max = 5.0))]
    pub convergence_m: f64,
    /// Damping ratio of the centering law; 1 is critical damping.
    #[default(1.0)]
    #[schemars(range(min = 0.5, max = 2.0))]
    pub damping: f64,
    /// Lateral offset at which the steering saturates.
    #[default(0.6)]
    #[schemars(range(min = 0.1, max = 2.0), extend("former_name" = "largest_offset_m"))]
    pub max_offset_m: f64,
    /// Maximum turn rate.
    #[default(0.8)]
    #[schemars(range(min = 0.1, max = 3.0), extend("former_name" = "largest_turn_radps"))]
    pub max_turn_radps: f64,
    /// Distance kept from the only visible wall while the corridor's width is unknown.
    #[default(0.6)]
    #[schemars(range(min = 0.2, max = 3.0))]
    pub single_wall_m: f64,
    /// Clearance between the robot's circle and a wall below which the robot steers away.
    #[default(0.15)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub near_wall_m: f64,
    /// Clearance between the robot's circle and a wall below which the robot stops and turns away in place.
    #[default(0.05)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stop_wall_m: f64,
    /// Standard deviation of the camera's tilt and roll. Not given: 1°, or 8° where the calibration is guessed; method `evidence` searches
    /// with 8°, and where the calibration is guessed anywhere.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub horizon_sigma_deg: Option<f64>,
    /// Minimum contrast across a floor line, gray levels.
    #[default(8.0)]
    #[schemars(range(min = 1.0, max = 100.0))]
    pub floor_contrast: f64,
    /// Width of a corridor below which one of its two floor lines is taken for a joint, a shadow or a mirror image.
    #[default(0.8)]
    #[schemars(range(min = 0.0, max = 3.0))]
    pub min_width_m: f64,
    /// Use of the motion between pictures: if set, a line is no wall where what is beyond it moves as floor, such as a joint of planks
    /// or an edge of sunlight. Has no effect without odometry, or with a camera whose height is unknown or whose lens distorts.
    #[default(true)]
    pub uses_motion: bool,
    /// Method `evidence`: distance from the camera to a wall ahead at which the robot stops; of a camera whose height is unknown, for a height of 0.3 m.
    #[default(0.6)]
    #[schemars(range(min = 0.2, max = 3.0))]
    pub stop_ahead_m: f64,
    /// Method `evidence`: motion at the end of the corridor.
    pub at_end: AtEnd,
    /// Recovery when no vanishing point is found.
    pub lost: Lost,
}

/// Method of finding the corridor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The vanishing point nearest to the presumed horizon, always believed; walls ahead are not looked for.
    #[default]
    PresumedHorizon,
    /// Vanishing point without a presumed horizon, with the probability of a corridor. A corridor with few lines is not recognized.
    Evidence,
}

/// Motion at the end of a corridor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AtEnd {
    /// The robot stops.
    #[default]
    Stop,
    /// The robot turns back in place; requires odometry.
    Turn,
}

/// Recovery when no vanishing point is found.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Lost {
    /// Maximum time of coasting at half speed.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub coast_s: f64,
    /// Maximum distance of coasting at half speed.
    #[default(0.5)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub coast_m: f64,
    /// Maximum turn to either side while searching; 0 disables the search.
    #[default(30.0)]
    #[schemars(range(min = 0.0, max = 90.0))]
    pub search_deg: f64,
    /// Turn between two search poses.
    #[default(10.0)]
    #[schemars(range(min = 2.0, max = 45.0))]
    pub step_deg: f64,
    /// Maximum distance from where the corridor was followed last up to which the robot creeps on in its direction before it searches.
    /// Only where other behaviors see what stands in the way.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub creep_m: f64,
}

impl Config {
    /// Checks the parameters against each other.
    ///
    /// # Errors
    /// The key to change.
    pub fn check(&self) -> Result<(), ParameterError> {
        if self.stop_wall_m > self.near_wall_m {
            let (stop_m, near_m) = (self.stop_wall_m, self.near_wall_m);
            let problem = format!("must be at most near_wall_m, {near_m} m, but is {stop_m} m: lower it");
            return Err(ParameterError::new("stop_wall_m", problem));
        }
        let Lost { search_deg, step_deg, .. } = self.lost;
        if search_deg > 0.0 && step_deg > search_deg {
            let problem =
                format!("must be at most search_deg, {search_deg} degrees, but is {step_deg}: lower it");
            return Err(ParameterError::new("lost.step_deg", problem));
        }
        Ok(())
    }

    /// Returns which keys have no effect.
    pub fn notes(&self) -> Vec<String> {
        let evidence = self.method == Method::Evidence;
        let keys = [
            (self.at_end != AtEnd::default(), "at_end"),
            (self.stop_ahead_m != Self::default().stop_ahead_m, "stop_ahead_m"),
        ];
        let unused = keys.into_iter().filter(|(is_set, _)| *is_set && !evidence);
        unused
            .map(|(_, key)| {
                format!("`{key}` has no effect: only method = \"evidence\" looks for walls ahead")
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_without_a_look_is_refused() {
        let lost = |search_deg: f64, step_deg: f64| Config {
            lost: Lost { search_deg, step_deg, ..Lost::default() },
            ..Config::default()
        };
        assert!(lost(30.0, 45.0).check().unwrap_err().to_string().contains("step_deg"));
        assert!(lost(30.0, 30.0).check().is_ok());
        assert!(lost(0.0, 10.0).check().is_ok(), "no search");
    }

    #[test]
    fn keys_of_the_other_method_are_named() {
        let turns = Config { at_end: AtEnd::Turn, ..Config::default() };
        assert!(turns.notes()[0].contains("`at_end`") && Config::default().notes().is_empty());
        assert!(Config { method: Method::Evidence, ..turns }.notes().is_empty());
    }
}
