//! File format of a learned floor's look.

use std::path::Path;

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::{FileKind, ParameterError};

use super::learned::LearnedLook;
use super::modes::Mode;

/// Version of the format.
const VERSION: u32 = 1;

/// File kind of a floor's look.
pub const FLOOR_APPEARANCE_FILE: FileKind = FileKind {
    key: "floor_appearance",
    what: "a file of a floor's look",
    schema: || schema_for!(AppearanceFile),
    rules: |table| match table.clone().try_into::<AppearanceFile>() {
        Ok(file) => file.look().err().into_iter().collect(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Content of a file of a floor's look.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AppearanceFile {
    /// Version of the format: 1.
    pub version: u32,
    /// Modes of the floor's look.
    #[schemars(length(min = 1, max = 4))]
    pub modes: Vec<ModeEntry>,
}

/// One mode: red and green chromaticity, log intensity, log gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModeEntry {
    /// Mean of each feature.
    pub mean: [f32; 4],
    /// Standard deviation of each feature, above 0.
    pub deviation: [f32; 4],
    /// Number of blocks that the mode was learned from, above 0.
    pub mass: f32,
}

impl From<&LearnedLook> for AppearanceFile {
    fn from(look: &LearnedLook) -> Self {
        let entry = |mode: &Mode| ModeEntry { mean: mode.mean, deviation: mode.deviation, mass: mode.mass };
        Self { version: VERSION, modes: look.modes().iter().map(entry).collect() }
    }
}

impl AppearanceFile {
    /// Converts the content to a look.
    ///
    /// # Errors
    /// Another version, no mode, more than four, or values that are not finite or not positive.
    pub fn look(&self) -> Result<LearnedLook, ParameterError> {
        if self.version != VERSION {
            let problem = format!("must be {VERSION}: learn the floor again");
            return Err(ParameterError::new("version", problem));
        }
        if !(1..=4).contains(&self.modes.len()) {
            return Err(ParameterError::new("modes", "must have 1 to 4 modes"));
        }
        let is_valid = |mode: &ModeEntry| {
            mode.mean.iter().all(|value| value.is_finite())
                && mode.deviation.iter().chain([&mode.mass]).all(|value| *value > 0.0 && value.is_finite())
        };
        if !self.modes.iter().all(is_valid) {
            return Err(ParameterError::new(
                "modes",
                "must have finite means, and positive deviations and masses",
            ));
        }
        let modes: Vec<Mode> = self
            .modes
            .iter()
            .map(|entry| Mode { mean: entry.mean, deviation: entry.deviation, mass: entry.mass })
            .collect();
        Ok(LearnedLook::from_modes(&modes))
    }

    /// Reads and validates a file.
    ///
    /// # Errors
    /// Message about a file that cannot be read, or about all invalid content.
    pub fn read(path: &Path) -> Result<LearnedLook, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        let table = FLOOR_APPEARANCE_FILE.read(&name, &text).map_err(|problems| problems.to_string())?;
        let file: Self = table.try_into().map_err(|error| format!("{name}: {error}"))?;
        file.look().map_err(|error| format!("{name}: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODE: &str = "mean = [0.3, 0.3, 5.0, -3.0], deviation = [0.01, 0.01, 0.2, 0.3], mass = 40.0";

    fn problem(text: &str) -> Option<String> {
        FLOOR_APPEARANCE_FILE.read("look.toml", text).err().map(|problems| problems.to_string())
    }

    #[test]
    fn a_look_survives_its_file() {
        let text = format!("version = 1\nmodes = [{{ {MODE} }}]");
        assert_eq!(problem(&text), None);
        let file: AppearanceFile =
            FLOOR_APPEARANCE_FILE.read("look.toml", &text).unwrap().try_into().unwrap();
        let look = file.look().unwrap();
        assert_eq!(AppearanceFile::from(&look), file);
        assert_eq!(look.modes()[0].mass, 40.0);
    }

    #[test]
    fn invalid_files_are_rejected() {
        let reports = |text: &str, expected: &str| {
            let message = problem(text).expect("a problem");
            assert!(message.contains(expected), "{message}");
        };
        reports(&format!("version = 2\nmodes = [{{ {MODE} }}]"), "version");
        reports("version = 1\nmodes = []", "1");
        reports(&format!("version = 1\nmodes = [{{ {} }}]", MODE.replace("0.2", "-0.2")), "positive");
        reports("version = 1\nmode = []", "mode");
    }
}
