//! The parameters of the behaviour.

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
    pub turn_rad_s: f64,
    /// Distance from the robot's circle to what it would stop before, m, 0 to 3, default 0.35.
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
    /// Least difference between the means of dark and bright pixels, grey levels, 10 to 200, default 25.
    #[schemars(range(min = 10.0, max = 200.0))]
    pub least_contrast: f64,
    /// A floor whose darker part has less than this share of its brighter part's grey level is two things, 0 (take them for one)
    /// to 1, default 0.7.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor_evenness: f64,
    /// Blocked on both sides, the robot looks around after so long, s, 0.1 to 600, default 3.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub patience_s: f64,
}

/// How free floor is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A grid of floor and obstacles in the picture of one forward camera.
    NavelGrid,
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
            turn_rad_s: 0.4,
            margin_m: 0.35,
            side_m: 0.05,
            freer_side_m: 0.4,
            columns: GridSize::PAPER.columns as u32,
            rows: GridSize::PAPER.rows as u32,
            cell_px: GridSize::PAPER.cell_px as u32,
            polarity: PolarityRule::BrightFloor,
            least_contrast: 25.0,
            floor_evenness: 0.7,
            patience_s: 3.0,
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
            ("turn_rad_s", self.turn_rad_s, 0.05, 3.0),
            ("margin_m", self.margin_m, 0.0, 3.0),
            ("side_m", self.side_m, 0.0, 1.0),
            ("freer_side_m", self.freer_side_m, 0.0, 3.0),
            ("columns", f64::from(self.columns), 5.0, 85.0),
            ("rows", f64::from(self.rows), 3.0, 45.0),
            ("cell_px", f64::from(self.cell_px), 4.0, 64.0),
            ("least_contrast", self.least_contrast, 10.0, 200.0),
            ("floor_evenness", self.floor_evenness, 0.0, 1.0),
            ("patience_s", self.patience_s, 0.1, 600.0),
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
