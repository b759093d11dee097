//! Parameters of the behavior.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::navel_grid::cells::GridSize;

/// Parameters of [`FreeSpaceAvoider`](crate::FreeSpaceAvoider).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Method of detecting free floor.
    pub method: Method,
    /// Cruising speed.
    #[default(0.3)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Rate of turns in place.
    #[default(0.4)]
    #[schemars(range(min = 0.05, max = 3.0))]
    pub turn_radps: f64,
    /// Distance from the robot's circle to an obstacle at which the robot stops (navel-grid), or clearance kept on every
    /// side (polar-cells).
    #[default(0.35)]
    #[schemars(range(min = 0.0, max = 3.0))]
    pub margin_m: f64,
    /// Clearance on both sides of the robot's circle that the path ahead requires (navel-grid).
    #[default(0.05)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub side_m: f64,
    /// Width of the strip on each side of the path ahead in which free floor is counted to choose the freer side
    /// (navel-grid).
    #[default(0.4)]
    #[schemars(range(min = 0.0, max = 3.0))]
    pub freer_side_m: f64,
    /// Number of columns of the grid (navel-grid).
    #[default(GridSize::PAPER.columns as u32)]
    #[schemars(range(min = 5, max = 85))]
    pub columns: u32,
    /// Number of rows of the grid (navel-grid).
    #[default(GridSize::PAPER.rows as u32)]
    #[schemars(range(min = 3, max = 45))]
    pub rows: u32,
    /// Side of a cell in the image scaled to the grid (navel-grid).
    #[default(GridSize::PAPER.cell_px as u32)]
    #[schemars(range(min = 4, max = 64))]
    pub cell_px: u32,
    /// Evidence that distinguishes floor from obstacles (navel-grid).
    pub evidence: Evidence,
    /// Path of the file with the floor's look, relative to the task file (navel-grid with `evidence = "look"`). Without it,
    /// the foreground at the start is floor.
    #[schemars(extend("format" = "file"))]
    pub floor_appearance: Option<String>,
    /// Brightness of the floor relative to obstacles (navel-grid).
    pub polarity: PolarityRule,
    /// Minimum difference between the mean of dark pixels and the mean of bright pixels, gray levels (navel-grid).
    #[default(25.0)]
    #[schemars(range(min = 10.0, max = 200.0))]
    pub min_contrast: f64,
    /// Minimum ratio of the mean gray levels of the floor's darker and brighter parts; below it they are two surfaces,
    /// and 0 disables the test (navel-grid).
    #[default(0.7)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor_evenness: f64,
    /// Choice of the heading while the path ahead is free (navel-grid).
    pub heading: HeadingRule,
    /// Time for which the robot is blocked before it looks around (navel-grid) or reports that it is blocked
    /// (polar-cells).
    #[default(3.0)]
    #[schemars(range(min = 0.1, max = 600.0), extend("former_name" = "patience_s"))]
    pub blocked_timeout_s: f64,
    /// Number of rings of cells (polar-cells).
    #[default(6)]
    #[schemars(range(min = 2, max = 64))]
    pub rings: u32,
    /// Number of directions of cells (polar-cells).
    #[default(32)]
    #[schemars(range(min = 8, max = 128))]
    pub directions: u32,
    /// Distance on the floor from the mirror's axis to the outer border of the last ring (polar-cells).
    #[default(1.25)]
    #[schemars(range(min = 0.2, max = 10.0), extend("former_name" = "farthest_m"))]
    pub max_range_m: f64,
    /// Minimum fraction of floor pixels in a free cell (polar-cells).
    #[default(0.8)]
    #[schemars(range(min = 0.1, max = 1.0))]
    pub free_share: f64,
    /// Radius of the morphological closing that removes lines and specks from the floor (polar-cells). Thin obstacles are
    /// removed too.
    #[default(1)]
    #[schemars(range(min = 0, max = 4))]
    pub closing_px: u32,
    /// Path of the file with the floor's colors, written by `yamabico learn floor`, relative to the task file
    /// (polar-cells). Without it, the colors are taken in front of the robot at the start.
    #[schemars(extend("format" = "file"))]
    pub floor_colors: Option<String>,
    /// Maximum difference per channel, levels, between a floor pixel and the colors taken at the start (polar-cells).
    #[default(24)]
    #[schemars(range(min = 2, max = 80))]
    pub color_tolerance: u32,
    /// Goal x and y: in the map frame if `pose` is connected, else in the odometry frame (polar-cells). Without it, the
    /// robot keeps its initial direction.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)), extend("format" = "map-position"))]
    pub goal_m: Option<[f64; 2]>,
    /// Distance at which the goal is reached (polar-cells).
    #[default(0.1)]
    #[schemars(range(min = 0.01, max = 2.0))]
    pub tolerance_m: f64,
    /// Use of the robot's velocity in the choice of a direction (polar-cells).
    pub velocity: VelocityRule,
}

/// Method of detecting free floor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Grid of floor and obstacle cells in the image of one forward camera.
    #[default]
    NavelGrid,
    /// Polar cells of floor color in the image of a mirror camera.
    PolarCells,
}

/// Evidence that distinguishes floor from obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Evidence {
    /// The floor is brighter, or darker, than obstacles.
    #[default]
    Brightness,
    /// The floor looks like what was in front of the robot at the start, and later like what was driven over: color,
    /// brightness and texture, up to the next edge.
    Look,
}

/// Choice of the heading of a robot with a forward camera while the path ahead is free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingRule {
    /// Straight ahead with a slight turn to the side with the lower weight.
    #[default]
    Weights,
    /// The heading nearest to straight ahead that is clear of obstacles, chosen as by polar-cells; requires odometry.
    Clearance,
}

/// Use of the robot's velocity in the choice of a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VelocityRule {
    /// Directions are judged by the trajectory that the robot can follow from its velocity.
    #[default]
    Considered,
    /// Directions are judged as if the robot could turn at once; for comparison.
    Ignored,
}

/// Brightness of the floor relative to obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PolarityRule {
    /// The floor is brighter.
    #[default]
    BrightFloor,
    /// The floor is darker.
    DarkFloor,
    /// Taken from the first frame, which shows floor directly in front of the robot.
    Auto,
}

impl Config {
    /// Returns the size of the grid.
    #[must_use]
    pub fn grid(&self) -> GridSize {
        GridSize { columns: self.columns as usize, rows: self.rows as usize, cell_px: self.cell_px as usize }
    }
}
