//! File format of floor colors, as written by `yamabico learn floor`.

use std::path::Path;

use crate::floor_color::{ColorBox, ColorTable, FloorColors};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::{FileKind, ParameterError};

/// File kind of floor colors.
pub const FLOOR_COLORS_FILE: FileKind = FileKind {
    key: "floor_colors",
    what: "a file of floor colors",
    schema: || schema_for!(ColorFile),
    rules: |table| match table.clone().try_into::<ColorFile>() {
        Ok(file) => file.colors().err().into_iter().collect(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Content of a floor color file: either thresholds or a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColorFile {
    /// Lower and upper thresholds of red, green and blue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thresholds: Option<ColorBox>,
    /// Table of 32 x 32 x 32 color classes: 32 lines of 256 hexadecimal digits, one line per class of red, eight digits
    /// per class of green, lowest bit for the lowest blue.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 32, max = 32))]
    pub table: Option<Vec<String>>,
}

impl From<&FloorColors> for ColorFile {
    fn from(colors: &FloorColors) -> Self {
        match colors {
            FloorColors::Box(thresholds) => Self { thresholds: Some(*thresholds), table: None },
            FloorColors::Table(table) => Self { thresholds: None, table: Some(table.to_lines()) },
        }
    }
}

impl ColorFile {
    /// Converts the content to a color model.
    ///
    /// # Errors
    /// Neither or both of thresholds and table, a lower threshold above its upper one, or lines that are not a table.
    pub fn colors(&self) -> Result<FloorColors, ParameterError> {
        match (&self.thresholds, &self.table) {
            (Some(thresholds), None) if (0..3).all(|i| thresholds.min[i] <= thresholds.max[i]) => {
                Ok(FloorColors::Box(*thresholds))
            }
            (Some(_), None) => Err(ParameterError::new(
                "thresholds",
                "has a `min` above its `max`, so that no color is floor: swap them",
            )),
            (None, Some(lines)) => {
                let table = ColorTable::from_lines(lines).ok_or_else(|| {
                    ParameterError::new(
                        "table",
                        "must be 32 lines of 256 hexadecimal digits: run `yamabico learn floor` again",
                    )
                })?;
                Ok(FloorColors::Table(table))
            }
            _ => Err(ParameterError::new("", "must have either `thresholds` or a `table`")),
        }
    }

    /// Reads and validates a file.
    ///
    /// # Errors
    /// Message about a file that cannot be read, or about all invalid content.
    pub fn read(path: &Path) -> Result<FloorColors, String> {
        let file: Self = FLOOR_COLORS_FILE.load(path).map_err(|error| error.to_string())?;
        file.colors().map_err(|error| format!("{}: {error}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_files_are_rejected() {
        let problem = |text: &str| FLOOR_COLORS_FILE.read("floor.toml", text).err().map(|p| p.to_string());
        assert_eq!(problem("thresholds = { min = [0, 80, 0], max = [90, 255, 90] }"), None);
        let reports = |text: &str, expected: &str| {
            let message = problem(text).expect("a problem");
            assert!(message.contains(expected), "{message}");
        };
        reports("", "either");
        reports("thresholds = { min = [0, 80, 0], max = [90, 70, 90] }", "above");
        reports("thresholds = { min = [0, 80, 0], max = [90, 256, 90] }", "255");
        reports("thresholds = { least = [0, 80, 0], max = [90, 255, 90] }", "did you mean `min`?");
        reports(&format!("table = [{}]", "'00',".repeat(32)), "256 hexadecimal");
        reports("tabel = []", "table");
    }
}
