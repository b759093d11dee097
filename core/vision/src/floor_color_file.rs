//! The colors of a floor in a file, as `yamabico learn floor` writes them.

use std::path::Path;

use crate::floor_color::{ColorBox, ColorTable, FloorColors};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::{BuildError, FileKind};

/// Files of floor colors, as the behavior names them.
pub const FLOOR_COLORS_FILE: FileKind = FileKind {
    key: "floor_colors",
    what: "a file of floor colors",
    schema: || schema_for!(ColorFile),
    rules: |table| match table.clone().try_into::<ColorFile>() {
        Ok(file) => file.colors().err().into_iter().collect(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// What stands in a file: thresholds or a table, not both.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColorFile {
    /// Smallest and largest red, green and blue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thresholds: Option<ColorBox>,
    /// A class for each of 32 x 32 x 32 colors: 32 lines of 256 hexadecimal digits, a line a class of red, eight digits a class of
    /// green, lowest bit for no blue.
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
    /// The colors.
    ///
    /// # Errors
    /// Neither thresholds nor a table, both, thresholds in the wrong order, or lines that are no table.
    pub fn colors(&self) -> Result<FloorColors, BuildError> {
        match (&self.thresholds, &self.table) {
            (Some(thresholds), None) if (0..3).all(|i| thresholds.least[i] <= thresholds.most[i]) => {
                Ok(FloorColors::Box(*thresholds))
            }
            (Some(_), None) => {
                Err(BuildError::new("thresholds", "has a `least` above its `most`: no color is floor"))
            }
            (None, Some(lines)) => {
                let table = ColorTable::from_lines(lines).ok_or_else(|| {
                    BuildError::new("table", "needs 32 lines of 256 hexadecimal digits: learn it again")
                })?;
                Ok(FloorColors::Table(table))
            }
            _ => Err(BuildError::new("", "either `thresholds` or a `table` is needed")),
        }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong in it, in words.
    pub fn read(path: &Path) -> Result<FloorColors, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        let table = FLOOR_COLORS_FILE.read(&name, &text).map_err(|problems| problems.to_string())?;
        let file: Self = table.try_into().map_err(|error| format!("{name}: {error}"))?;
        file.colors().map_err(|error| format!("{name}: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_say_what_is_wrong_with_them() {
        let problem = |text: &str| FLOOR_COLORS_FILE.read("floor.toml", text).err().map(|p| p.to_string());
        assert_eq!(problem("thresholds = { least = [0, 80, 0], most = [90, 255, 90] }"), None);
        let told = |text: &str, word: &str| {
            let told = problem(text).expect("a problem");
            assert!(told.contains(word), "{told}");
        };
        told("", "either");
        told("thresholds = { least = [0, 80, 0], most = [90, 70, 90] }", "above");
        told("thresholds = { least = [0, 80, 0], most = [90, 256, 90] }", "255");
        told(&format!("table = [{}]", "'00',".repeat(32)), "256 hexadecimal");
        told("tabel = []", "table");
    }
}
