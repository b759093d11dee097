use std::path::Path;

use nalgebra::Point2;
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::BuildError;
use yamabico_core::parameters::FileKind;
use yamabico_vision::polygon::{is_simple, signed_area};

use super::floor_plan::FloorPlan;

/// Files of floor plans, as the behavior names them.
pub const FLOOR_PLAN_FILE: FileKind = FileKind {
    key: "floor_plan",
    what: "a plan of a floor",
    schema: || schema_for!(FloorPlanFile),
    rules: |table| match table.clone().try_into::<FloorPlanFile>() {
        Ok(file) => file.plan().err().into_iter().collect(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// What stands in a file: the corners of the floor.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FloorPlanFile {
    /// Corners of the floor, x and y on the map, meters, each -1000 to 1000, one after the other all around.
    #[schemars(length(min = 3, max = 500), inner(inner(range(min = -1000.0, max = 1000.0))))]
    pub corners_m: Vec<[f64; 2]>,
}

impl FloorPlanFile {
    /// The corners, counterclockwise.
    #[must_use]
    pub fn corners(&self) -> Vec<Point2<f64>> {
        let mut corners: Vec<_> = self.corners_m.iter().map(|&corner| Point2::from(corner)).collect();
        if signed_area(&corners) < 0.0 {
            corners.reverse();
        }
        corners
    }

    /// The plan.
    ///
    /// # Errors
    /// Sides that cross each other, or no floor between them.
    pub fn plan(&self) -> Result<FloorPlan, BuildError> {
        let corners = self.corners();
        if !is_simple(&corners) {
            return Err(BuildError::new("corners_m", "sides cross each other: list the corners all around"));
        }
        FloorPlan::from_polygon(&corners).map_err(|error| BuildError::new("corners_m", error.to_string()))
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong in it, in words.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        let table = FLOOR_PLAN_FILE.read(&name, &text).map_err(|problems| problems.to_string())?;
        table.try_into().map_err(|error| format!("{name}: {error}"))
    }
}
