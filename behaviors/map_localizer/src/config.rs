//! The parameters of the behavior.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{BuildError, Setup};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;
use crate::motion::MotionNoise;

/// Parameters of [`MapLocalizer`](crate::MapLocalizer).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// How the robot is found, default wireframe.
    #[serde(default)]
    pub method: Method,
    /// A wire-frame map, for method wireframe: a file, relative to the task file. Default none.
    #[schemars(extend("format" = "file"))]
    pub map: Option<String>,
    /// A map of vertical edges, for method azimuth, as `yamabico learn map` writes it: a file, relative to the task file.
    /// Default none.
    #[schemars(extend("format" = "file"))]
    pub edge_map: Option<String>,
    /// A plan of the floor, for method floor-outline: a file, relative to the task file. Default none.
    #[schemars(extend("format" = "file"))]
    pub floor_plan: Option<String>,
    /// The colors of the floor, for method floor-outline, as `yamabico learn floor` writes them: a file, relative to the
    /// task file. Default none.
    #[schemars(extend("format" = "file"))]
    pub floor_colors: Option<String>,
    /// Where the robot is at the beginning.
    #[serde(default)]
    pub start: Start,
    /// Corners of the way to go, x and y on the map, m, each -1000000 to 1000000; the last one is the goal. Default none:
    /// the robot waits for a goal.
    #[serde(default)]
    #[schemars(inner(inner(range(min = -1e6, max = 1e6))), length(max = 60))]
    pub route: Vec<[f64; 2]>,
    /// Cruising speed, m/s, 0.02 to 2, default 0.4.
    #[serde(default = "speed_mps")]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Largest turn rate, rad/s, 0.1 to 3, default 0.8.
    #[serde(default = "largest_turn_radps")]
    #[schemars(range(min = 0.1, max = 3.0))]
    pub largest_turn_radps: f64,
    /// Distance of the point of the path that it steers for, m, 0.2 to 5, default 0.8.
    #[serde(default = "look_ahead_m")]
    #[schemars(range(min = 0.2, max = 5.0))]
    pub look_ahead_m: f64,
    /// The goal of the route is reached within this distance, m, 0.02 to 5, default 0.2.
    #[serde(default = "tolerance_m")]
    #[schemars(range(min = 0.02, max = 5.0))]
    pub tolerance_m: f64,
    /// Distance that a path keeps from the map's walls beyond the robot's radius, m, 0 to 2, default 0.1.
    #[serde(default = "wall_margin_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub wall_margin_m: f64,
    /// Whether a picture's result is applied at the instant that it was taken, and the motion since then done again;
    /// otherwise it moves the newest pose, for comparison. Default true.
    #[serde(default = "retroactive")]
    pub retroactive: bool,
    /// How far a seen line's ends are off, pixels, 0.05 to 10, default 0.7.
    #[serde(default = "sigma_px")]
    #[schemars(range(min = 0.05, max = 10.0))]
    pub sigma_px: f64,
    /// How far the map's edges are off, m, 0 to 1, default 0.01.
    #[serde(default = "map_sigma_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub map_sigma_m: f64,
    /// Least standard deviation of the azimuth of an edge, degrees, 0.01 to 5, default 0.1. For method azimuth.
    #[serde(default = "azimuth_sigma_deg")]
    #[schemars(range(min = 0.01, max = 5.0))]
    pub azimuth_sigma_deg: f64,
    /// How far the camera's mast sways about its vertical from picture to picture, which no odometry tells, degrees, 0 to 10,
    /// default 0. For method azimuth.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sway_deg: f64,
    /// Pictures taken nearer to each other than this err alike, m, 0 to 10, default 0.5.
    #[serde(default = "correlation_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub correlation_m: f64,
    /// How uncertain the odometry is.
    #[serde(default)]
    pub odometry: OdometryNoise,
}

/// How the robot is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The edges of a wire-frame map, seen by a pinhole camera.
    #[default]
    Wireframe,
    /// The azimuths of the vertical edges of a map, seen by a mirror camera.
    Azimuth,
    /// The outline of the floor, seen by a mirror camera.
    FloorOutline,
    /// Not at all: the odometry carries the start on, without a map.
    DeadReckoning,
}

impl Method {
    /// As it stands in the configuration.
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

/// Where the robot is at the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// Along the map's x axis, m, -1000000 to 1000000, default 0.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub x_m: f64,
    /// Along the map's y axis, m, -1000000 to 1000000, default 0.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub y_m: f64,
    /// Heading, degrees, positive to the left, -180 to 180, default 0.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub heading_deg: f64,
    /// Standard deviation of the place along either axis, m, 0.005 to 5, default 0.1.
    #[schemars(range(min = 0.005, max = 5.0))]
    pub sigma_m: f64,
    /// Standard deviation of the heading, degrees, 0.1 to 90, default 3.
    #[schemars(range(min = 0.1, max = 90.0))]
    pub sigma_deg: f64,
}

/// How uncertain the odometry is: variances that motion adds.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometryNoise {
    /// Of the way, m^2 a meter, 0 to 1, default 0.0001.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ss: f64,
    /// Of the heading, rad^2 a radian of turning, 0 to 1, default 0.001.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_tt: f64,
    /// Of the heading, rad^2 a meter, 0 to 1, default 0.0006.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ts: f64,
    /// Standard deviation of a drift of the heading that stays the same, as of unequal wheels, degrees a meter, 0 to 60,
    /// default 0.6.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub drift_deg_per_m: f64,
}

impl Default for Start {
    fn default() -> Self {
        Self { x_m: 0.0, y_m: 0.0, heading_deg: 0.0, sigma_m: 0.1, sigma_deg: 3.0 }
    }
}

impl Default for OdometryNoise {
    fn default() -> Self {
        Self { k_ss: 1e-4, k_tt: 1e-3, k_ts: 6e-4, drift_deg_per_m: 0.6 }
    }
}

impl Start {
    /// As a belief.
    #[must_use]
    pub fn belief(&self) -> Belief {
        let pose = Pose2::new(self.x_m, self.y_m, self.heading_deg.to_radians());
        Belief::new(pose, self.sigma_m, self.sigma_deg.to_radians())
    }
}

impl From<OdometryNoise> for MotionNoise {
    fn from(noise: OdometryNoise) -> Self {
        Self {
            way_per_way_m: noise.k_ss,
            turn_per_turn_rad: noise.k_tt,
            turn_per_way: noise.k_ts,
            drift_per_way: noise.drift_deg_per_m.to_radians(),
        }
    }
}

impl Config {
    /// The path of a file that the method needs.
    ///
    /// # Errors
    /// The key is missing.
    pub fn file(&self, key: &str, file: Option<&String>, setup: &Setup) -> Result<PathBuf, BuildError> {
        let missing = || BuildError::new(key, format!("is missing: method {} needs it", self.method.name()));
        Ok(setup.folder.join(file.ok_or_else(missing)?))
    }

    /// Whether every number is in its range.
    ///
    /// # Errors
    /// The first key that is not, with its range.
    pub fn check(&self) -> Result<(), BuildError> {
        for (key, value, low, high) in [
            ("start.x_m", self.start.x_m, -1e6, 1e6),
            ("start.y_m", self.start.y_m, -1e6, 1e6),
            ("start.heading_deg", self.start.heading_deg, -180.0, 180.0),
            ("start.sigma_m", self.start.sigma_m, 0.005, 5.0),
            ("start.sigma_deg", self.start.sigma_deg, 0.1, 90.0),
            ("speed_mps", self.speed_mps, 0.02, 2.0),
            ("largest_turn_radps", self.largest_turn_radps, 0.1, 3.0),
            ("look_ahead_m", self.look_ahead_m, 0.2, 5.0),
            ("tolerance_m", self.tolerance_m, 0.02, 5.0),
            ("wall_margin_m", self.wall_margin_m, 0.0, 2.0),
            ("sigma_px", self.sigma_px, 0.05, 10.0),
            ("map_sigma_m", self.map_sigma_m, 0.0, 1.0),
            ("azimuth_sigma_deg", self.azimuth_sigma_deg, 0.01, 5.0),
            ("sway_deg", self.sway_deg, 0.0, 10.0),
            ("correlation_m", self.correlation_m, 0.0, 10.0),
            ("odometry.k_ss", self.odometry.k_ss, 0.0, 1.0),
            ("odometry.k_tt", self.odometry.k_tt, 0.0, 1.0),
            ("odometry.k_ts", self.odometry.k_ts, 0.0, 1.0),
            ("odometry.drift_deg_per_m", self.odometry.drift_deg_per_m, 0.0, 60.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(BuildError::new(key, format!("{value} is not between {low} and {high}")));
            }
        }
        if self.route.iter().flatten().any(|value| !value.is_finite()) {
            return Err(BuildError::new("route", "holds a number that is not finite"));
        }
        Ok(())
    }
}

fn speed_mps() -> f64 {
    0.4
}
fn largest_turn_radps() -> f64 {
    0.8
}
fn look_ahead_m() -> f64 {
    0.8
}
fn tolerance_m() -> f64 {
    0.2
}
fn wall_margin_m() -> f64 {
    0.1
}
fn retroactive() -> bool {
    true
}
fn sigma_px() -> f64 {
    0.7
}
fn map_sigma_m() -> f64 {
    0.01
}
fn azimuth_sigma_deg() -> f64 {
    0.1
}
fn correlation_m() -> f64 {
    0.5
}
