//! Parameters of the behavior.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;
use crate::motion::{MotionNoise, SlipNoise};

/// Parameters of [`MapLocalizer`](crate::MapLocalizer).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Method of localization.
    pub method: Method,
    /// Path of a wire-frame map, relative to the task file; required by method wireframe.
    #[schemars(extend("format" = "file"))]
    pub map: Option<String>,
    /// Path of a map of vertical edges, written by `yamabico learn map`, relative to the task file; required by method
    /// azimuth.
    #[schemars(extend("format" = "file"))]
    pub edge_map: Option<String>,
    /// Path of a floor plan, relative to the task file; required by method floor-outline.
    #[schemars(extend("format" = "file"))]
    pub floor_plan: Option<String>,
    /// Path of the floor's colors, written by `yamabico learn floor`, relative to the task file; required by method
    /// floor-outline.
    #[schemars(extend("format" = "file"))]
    pub floor_colors: Option<String>,
    /// Initial pose estimate.
    pub start: Start,
    /// Corners of the route, x and y in the map frame; the last corner is the goal. Without it, the robot waits for a
    /// goal.
    #[schemars(inner(inner(range(min = -1e6, max = 1e6))), length(max = 60), extend("format" = "map-positions"))]
    pub route: Vec<[f64; 2]>,
    /// Cruising speed.
    #[default(0.4)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Maximum turn rate.
    #[default(0.8)]
    #[schemars(range(min = 0.1, max = 3.0), extend("former_name" = "largest_turn_radps"))]
    pub max_turn_radps: f64,
    /// Distance along the path to the point that the robot steers toward.
    #[default(0.8)]
    #[schemars(range(min = 0.2, max = 5.0))]
    pub look_ahead_m: f64,
    /// Distance at which the goal of the route is reached.
    #[default(0.2)]
    #[schemars(range(min = 0.02, max = 5.0))]
    pub tolerance_m: f64,
    /// Clearance of a planned path from the map's walls, in addition to the robot's radius.
    #[default(0.1)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub wall_margin_m: f64,
    /// If true, an image corrects the pose at its capture time, and the motion since then is applied again; otherwise it
    /// corrects the newest pose, for comparison.
    #[default(true)]
    pub retroactive: bool,
    /// Standard deviation of the ends of a detected line.
    #[default(0.7)]
    #[schemars(range(min = 0.05, max = 10.0))]
    pub sigma_px: f64,
    /// Standard deviation of the map's edges.
    #[default(0.01)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub map_sigma_m: f64,
    /// Minimum standard deviation of the azimuth of an edge; used by method `azimuth`.
    #[default(0.1)]
    #[schemars(range(min = 0.01, max = 5.0))]
    pub azimuth_sigma_deg: f64,
    /// Standard deviation of the sway of the camera's mast about the vertical, which odometry does not measure;
    /// used by method `azimuth`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sway_deg: f64,
    /// Distance between two images below which their errors are correlated.
    #[default(0.5)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub correlation_m: f64,
    /// Noise model of the odometry.
    pub odometry: OdometryNoise,
}

/// Method of localization.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Edges of a wire-frame map in the image of a pinhole camera.
    #[default]
    Wireframe,
    /// Azimuths of the vertical edges of a map in the image of a mirror camera.
    Azimuth,
    /// Outline of the floor in the image of a mirror camera.
    FloorOutline,
    /// Odometry alone, without a map.
    DeadReckoning,
}

impl Method {
    /// Name in task files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wireframe => "wireframe",
            Self::Azimuth => "azimuth",
            Self::FloorOutline => "floor-outline",
            Self::DeadReckoning => "dead-reckoning",
        }
    }
}

/// Initial pose estimate, map frame.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// Position along the map's x axis.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub x_m: f64,
    /// Position along the map's y axis.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub y_m: f64,
    /// Heading, positive to the left.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub heading_deg: f64,
    /// Standard deviation of the position along each axis.
    #[default(0.1)]
    #[schemars(range(min = 0.005, max = 5.0))]
    pub sigma_m: f64,
    /// Standard deviation of the heading.
    #[default(3.0)]
    #[schemars(range(min = 0.1, max = 90.0))]
    pub sigma_deg: f64,
}

/// Noise model of the odometry: variances added by motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct OdometryNoise {
    /// Variance of the distance per distance driven, m²/m.
    #[default(1e-4)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ss: f64,
    /// Variance of the heading per angle turned, rad²/rad.
    #[default(1e-3)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_tt: f64,
    /// Variance of the heading per distance driven, rad²/m.
    #[default(6e-4)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ts: f64,
    /// Standard deviation of a constant drift of the heading, such as from unequal wheels, degrees per meter.
    #[default(0.6)]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub drift_deg_per_m: f64,
    /// Standard deviation of the delay between the motion of the body and the motion that odometry reports: wheels creep
    /// on the floor while speeds change.
    #[default(0.15)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub delay_s: f64,
    /// Acceleration or deceleration from which wheels slip.
    #[default(0.3)]
    #[schemars(range(min = 0.0, max = 20.0))]
    pub slip_from_mps2: f64,
    /// Standard deviation of the heading that slip adds in 0.1 s, radians per m/s² beyond `slip_from_mps2`.
    #[default(0.02)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_slip: f64,
}

impl Start {
    /// Returns the estimate as a Gaussian belief.
    #[must_use]
    pub fn belief(&self) -> Belief {
        let pose = Pose2::new(self.x_m, self.y_m, self.heading_deg.to_radians());
        Belief::new(pose, self.sigma_m, self.sigma_deg.to_radians())
    }
}

impl From<OdometryNoise> for MotionNoise {
    fn from(noise: OdometryNoise) -> Self {
        Self {
            distance_per_distance_m: noise.k_ss,
            turn_per_turn_rad: noise.k_tt,
            turn_per_distance: noise.k_ts,
            drift_per_distance: noise.drift_deg_per_m.to_radians(),
            delay_s: noise.delay_s,
            slip: SlipNoise { from_mps2: noise.slip_from_mps2, gain: noise.k_slip },
        }
    }
}

impl Config {
    /// Returns the path of a file that the method requires.
    ///
    /// # Errors
    /// The key is missing.
    pub fn file(&self, key: &str, file: Option<&String>, setup: &Setup) -> Result<PathBuf, ParameterError> {
        let missing = || {
            let problem = format!("is missing, and method {} requires it", self.method.name());
            ParameterError::new(key, problem).remedy(format!(
                "add {key} = \"...\", the path of a file relative to the task file, or choose another method"
            ))
        };
        Ok(setup.folder.join(file.ok_or_else(missing)?))
    }
}
