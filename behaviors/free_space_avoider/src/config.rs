//! The parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;

use crate::navel_grid::cells::GridSize;

/// Parameters of [`FreeSpaceAvoider`](crate::FreeSpaceAvoider).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// How free floor is seen, default "navel-grid".
    pub method: Method,
    /// Cruising speed, m/s, 0.02 to 2, default 0.3.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Rate of turns where the robot stands, rad/s, 0.05 to 3, default 0.4.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub turn_radps: f64,
    /// Distance from the robot's circle to what it would stop before (navel-grid), or keeps on every side (polar-cells), m, 0 to
    /// 3, default 0.35.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub margin_m: f64,
    /// Room beside the robot's circle that the way ahead needs, m, 0 to 1, default 0.05.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub side_m: f64,
    /// Width beside the way ahead that is weighed for the freer side, m, 0 to 3, default 0.4.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub freer_side_m: f64,
    /// Columns of the grid, cells, 5 to 85, default 17.
    #[schemars(range(min = 5, max = 85))]
    pub columns: u32,
    /// Rows of the grid, cells, 3 to 45, default 9.
    #[schemars(range(min = 3, max = 45))]
    pub rows: u32,
    /// Side of a cell, pixels of the picture scaled to the grid, 4 to 64, default 20.
    #[schemars(range(min = 4, max = 64))]
    pub cell_px: u32,
    /// Whether the floor is brighter than what stands on it, default "bright-floor".
    pub polarity: PolarityRule,
    /// Least difference between the means of dark and bright pixels, gray levels, 10 to 200, default 25.
    #[schemars(range(min = 10.0, max = 200.0))]
    pub min_contrast: f64,
    /// A floor whose darker part has less than this share of its brighter part's gray level is two things, 0 (take them for one)
    /// to 1, default 0.7.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor_evenness: f64,
    /// What the robot drives by while the way ahead is free (navel-grid), default "weights".
    pub heading: HeadingRule,
    /// Blocked on both sides, the robot looks around after so long; with polar-cells, blocked all around, it says so. Seconds,
    /// 0.1 to 600, default 3.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub patience_s: f64,
    /// Rings of polar cells, 2 to 64, default 6.
    #[schemars(range(min = 2, max = 64))]
    pub rings: u32,
    /// Directions of polar cells, 8 to 128, default 32.
    #[schemars(range(min = 8, max = 128))]
    pub directions: u32,
    /// The rings end where the floor is so far from the mirror's axis, m, 0.2 to 10, default 1.25.
    #[schemars(range(min = 0.2, max = 10.0))]
    pub farthest_m: f64,
    /// Share of floor that makes a cell free, 0.1 to 1, default 0.8.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub free_share: f64,
    /// Lines and specks in the floor up to twice so wide are closed, pixels, 0 to 4, default 1.
    #[schemars(range(min = 0, max = 4))]
    pub closing_px: u32,
    /// The floor's colors as `yamabico learn floor` writes them, relative to the task file. Default none: what lies before the
    /// robot at the start is floor.
    #[schemars(extend("format" = "file"))]
    pub floor_colors: Option<String>,
    /// Without learned colors: what differs from those before the robot by no more is floor, levels, 2 to 80, default 24.
    #[schemars(range(min = 2, max = 80))]
    pub color_tolerance: u32,
    /// Where to go, x and y, m, each -1000 to 1000: on the map where a pose is plugged in, else from where odometry began.
    /// Default none: on, in the direction that the robot looks in at the start.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub goal_m: Option<[f64; 2]>,
    /// How near the goal is there, m, 0.01 to 2, default 0.1.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub tolerance_m: f64,
    /// Whether directions are judged by the velocity that the robot has, default "considered".
    pub velocity: VelocityRule,
}

/// How free floor is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A grid of floor and obstacles in the picture of one forward camera.
    NavelGrid,
    /// Cells of floor color all around, in the picture of a mirror camera.
    PolarCells,
}

/// What a robot with a forward camera drives by while the way ahead is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingRule {
    /// Straight on, and a little to the side that weighs less.
    Weights,
    /// The heading nearest to straight on that keeps clear of what is seen, as polar-cells chooses; needs odometry.
    Clearance,
}

/// Whether directions are judged by the velocity that the robot has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VelocityRule {
    /// They are: by the way that the robot would really take.
    Considered,
    /// As if the robot could turn at once: for comparison.
    Ignored,
}

/// Whether the floor is brighter than what stands on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PolarityRule {
    /// It is.
    BrightFloor,
    /// It is darker.
    DarkFloor,
    /// The first picture tells: what lies right before the robot is floor.
    Auto,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            method: Method::NavelGrid,
            speed_mps: 0.3,
            turn_radps: 0.4,
            margin_m: 0.35,
            side_m: 0.05,
            freer_side_m: 0.4,
            columns: GridSize::PAPER.columns as u32,
            rows: GridSize::PAPER.rows as u32,
            cell_px: GridSize::PAPER.cell_px as u32,
            polarity: PolarityRule::BrightFloor,
            min_contrast: 25.0,
            floor_evenness: 0.7,
            heading: HeadingRule::Weights,
            patience_s: 3.0,
            rings: 6,
            directions: 32,
            farthest_m: 1.25,
            free_share: 0.8,
            closing_px: 1,
            floor_colors: None,
            color_tolerance: 24,
            goal_m: None,
            tolerance_m: 0.1,
            velocity: VelocityRule::Considered,
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
            ("turn_radps", self.turn_radps, 0.05, 3.0),
            ("margin_m", self.margin_m, 0.0, 3.0),
            ("side_m", self.side_m, 0.0, 1.0),
            ("freer_side_m", self.freer_side_m, 0.0, 3.0),
            ("columns", f64::from(self.columns), 5.0, 85.0),
            ("rows", f64::from(self.rows), 3.0, 45.0),
            ("cell_px", f64::from(self.cell_px), 4.0, 64.0),
            ("min_contrast", self.min_contrast, 10.0, 200.0),
            ("floor_evenness", self.floor_evenness, 0.0, 1.0),
            ("patience_s", self.patience_s, 0.1, 600.0),
            ("rings", f64::from(self.rings), 2.0, 64.0),
            ("directions", f64::from(self.directions), 8.0, 128.0),
            ("farthest_m", self.farthest_m, 0.2, 10.0),
            ("free_share", self.free_share, 0.1, 1.0),
            ("closing_px", f64::from(self.closing_px), 0.0, 4.0),
            ("color_tolerance", f64::from(self.color_tolerance), 2.0, 80.0),
            ("goal_m", self.goal_m.map_or(0.0, |goal| goal[0]), -1000.0, 1000.0),
            ("goal_m", self.goal_m.map_or(0.0, |goal| goal[1]), -1000.0, 1000.0),
            ("tolerance_m", self.tolerance_m, 0.01, 2.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(BuildError::new(key, format!("{value} is not between {low} and {high}")));
            }
        }
        Ok(())
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> GridSize {
        GridSize { columns: self.columns as usize, rows: self.rows as usize, cell_px: self.cell_px as usize }
    }
}
