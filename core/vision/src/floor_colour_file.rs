//! The colours of a floor in a file, as `yamabico learn floor` writes them.

use std::path::Path;

use crate::floor_colour::{ColourBox, ColourTable, FloorColours};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::{BuildError, FileKind};

/// Files of floor colours, as the behaviour names them.
pub const FLOOR_COLOURS_FILE: FileKind = FileKind {
    key: "floor_colours",
    what: "a file of floor colours",
    schema: || schema_for!(ColourFile),
    rules: |table| match table.clone().try_into::<ColourFile>() {
        Ok(file) => file.colours().err().into_iter().collect(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// What stands in a file: thresholds or a table, not both.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColourFile {
    /// Smallest and largest red, green and blue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thresholds: Option<ColourBox>,
    /// A class for each of 32 x 32 x 32 colours: 32 lines of 256 hexadecimal digits, a line a class of red, eight digits a class of
    /// green, lowest bit for no blue.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 32, max = 32))]
    pub table: Option<Vec<String>>,
}

impl From<&FloorColours> for ColourFile {
    fn from(colours: &FloorColours) -> Self {
        match colours {
            FloorColours::Box(thresholds) => Self { thresholds: Some(*thresholds), table: None },
            FloorColours::Table(table) => Self { thresholds: None, table: Some(table.to_lines()) },
        }
    }
}

impl ColourFile {
    /// The colours.
    ///
    /// # Errors
    /// Neither thresholds nor a table, both, thresholds in the wrong order, or lines that are no table.
    pub fn colours(&self) -> Result<FloorColours, BuildError> {
        match (&self.thresholds, &self.table) {
            (Some(thresholds), None) if (0..3).all(|i| thresholds.least[i] <= thresholds.most[i]) => {
                Ok(FloorColours::Box(*thresholds))
            }
            (Some(_), None) => {
                Err(BuildError::new("thresholds", "has a `least` above its `most`: no colour is floor"))
            }
            (None, Some(lines)) => {
                let table = ColourTable::from_lines(lines).ok_or_else(|| {
                    BuildError::new("table", "needs 32 lines of 256 hexadecimal digits: learn it again")
                })?;
                Ok(FloorColours::Table(table))
            }
            _ => Err(BuildError::new("", "either `thresholds` or a `table` is needed")),
        }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong in it, in words.
    pub fn read(path: &Path) -> Result<FloorColours, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        let table = FLOOR_COLOURS_FILE.read(&name, &text).map_err(|problems| problems.to_string())?;
        let file: Self = table.try_into().map_err(|error| format!("{name}: {error}"))?;
        file.colours().map_err(|error| format!("{name}: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_say_what_is_wrong_with_them() {
        let problem = |text: &str| FLOOR_COLOURS_FILE.read("floor.toml", text).err().map(|p| p.to_string());
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
