//! The goals of `yamabico goto`: X and Y from the command line, or a TOML file.

use std::path::Path;

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::FileKind;

use super::Arguments;
use crate::output::Failure;

/// Maximum absolute value of a coordinate, m.
const MAX_COORDINATE_M: f64 = 100_000.0;

/// A file of goals.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GoalFile {
    /// Goals, visited in this order.
    #[serde(rename = "goal")]
    #[schemars(length(min = 1, max = 1000))]
    goals: Vec<Goal>,
}

/// A goal on the map.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Position, map frame.
    #[schemars(range(min = -100_000.0, max = 100_000.0))]
    pub x_m: f64,
    /// Position, map frame.
    #[schemars(range(min = -100_000.0, max = 100_000.0))]
    pub y_m: f64,
    /// Heading at the goal, positive to the left; any heading if absent.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    pub heading_deg: Option<f64>,
    /// Distance from the goal at which it is reached.
    #[serde(default = "tolerance_m")]
    #[schemars(range(min = 0.01, max = 100.0))]
    pub tolerance_m: f64,
}

const GOAL_FILE: FileKind = FileKind {
    key: "goals",
    what: "a file of goals",
    schema: || schema_for!(GoalFile),
    rules: |_| Vec::new(),
};

/// Reads the goals of the command line.
pub fn read(arguments: &Arguments) -> Result<Vec<Goal>, Failure> {
    let file = match arguments.goal.as_slice() {
        [x, y] => return Ok(vec![one_goal(x, y, arguments)?]),
        [file] if file.parse::<f64>().is_ok() => {
            return Err(Failure::usage(format!("Y is missing after X = {file}: give both, in meters")));
        }
        [file] => Path::new(file),
        _ => return Err(Failure::usage("give X and Y in meters, or a file of goals")),
    };
    let text = std::fs::read_to_string(file).map_err(|error| {
        let file = file.display();
        Failure::usage(format!("file of goals {file} cannot be read: {error}; write `goto X Y` in meters, or name a file of goals"))
    })?;
    let table = GOAL_FILE.read(&file.display().to_string(), &text)?;
    let goals: Result<GoalFile, toml::de::Error> = table.try_into();
    goals.map(|file| file.goals).map_err(|error| Failure::usage(format!("{}: {error}", file.display())))
}

fn one_goal(x: &str, y: &str, arguments: &Arguments) -> Result<Goal, Failure> {
    let coordinate = |name: &str, text: &str| {
        let number = text.parse().ok().filter(|number: &f64| number.abs() <= MAX_COORDINATE_M);
        number.ok_or_else(|| {
            Failure::usage(format!(
                "{name} = `{text}` is not a position on a map: give meters, for example 12.5"
            ))
        })
    };
    let (x_m, y_m, tolerance_m) = (coordinate("X", x)?, coordinate("Y", y)?, arguments.tolerance);
    if !(0.01..=100.0).contains(&tolerance_m) {
        return Err(Failure::usage(format!("--tolerance must be 0.01 to 100 m, but is {tolerance_m} m")));
    }
    let heading_deg = arguments.heading.filter(|heading| heading.is_finite());
    Ok(Goal { x_m, y_m, heading_deg, tolerance_m })
}

/// The default tolerance of a goal, m.
pub fn tolerance_m() -> f64 {
    0.3
}
