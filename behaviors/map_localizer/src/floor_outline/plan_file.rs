use std::path::Path;

use nalgebra::Point2;
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::ParameterError;
use yamabico_core::parameters::FileKind;
use yamabico_vision::polygon::{is_simple, signed_area};

use super::floor_plan::FloorPlan;

/// File kind of floor plans.
pub const FLOOR_PLAN_FILE: FileKind = FileKind {
    key: "floor_plan",
    what: "a plan of a floor",
    schema: || schema_for!(FloorPlanFile),
    rules: |table| match table.clone().try_into::<FloorPlanFile>() {
        Ok(file) => file.plan().err().into_iter().collect(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Content of a floor plan file: the corners of the floor.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FloorPlanFile {
    /// Corners of the floor, x and y in the map frame, in order around the floor.
    #[schemars(length(min = 3, max = 500), inner(inner(range(min = -1000.0, max = 1000.0))))]
    pub corners_m: Vec<[f64; 2]>,
}

impl FloorPlanFile {
    /// Returns the corners, counterclockwise.
    #[must_use]
    pub fn corners(&self) -> Vec<Point2<f64>> {
        let mut corners: Vec<_> = self.corners_m.iter().map(|&corner| Point2::from(corner)).collect();
        if signed_area(&corners) < 0.0 {
            corners.reverse();
        }
        corners
    }

    /// Creates the floor plan.
    ///
    /// # Errors
    /// Sides cross each other, or the corners enclose no area.
    pub fn plan(&self) -> Result<FloorPlan, ParameterError> {
        let corners = self.corners();
        if !is_simple(&corners) {
            let problem = "sides cross each other: list the corners in order around the floor";
            return Err(ParameterError::new("corners_m", problem));
        }
        FloorPlan::from_polygon(&corners).map_err(|error| ParameterError::new("corners_m", error.to_string()))
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// The file cannot be read, or its content is invalid; the text lists all problems.
    pub fn read(path: &Path) -> Result<Self, String> {
        FLOOR_PLAN_FILE.load(path).map_err(|error| error.to_string())
    }
}
