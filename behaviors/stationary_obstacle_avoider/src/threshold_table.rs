//! The thresholds learned in a building, as a TOML file: what the difference of edges was at each place while nothing stood
//! in the way.

use std::path::Path;

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::BuildError;
use yamabico_core::geometry::Pose2;
use yamabico_core::parameters::{FileKind, Problems};

use crate::obstacle_regions::nearest;

/// Tables of thresholds, as the behavior names them.
pub const THRESHOLD_FILE: FileKind = FileKind {
    key: "thresholds",
    what: "a table of thresholds",
    schema: || schema_for!(ThresholdTable),
    rules: |table| match table.clone().try_into::<ThresholdTable>() {
        Ok(table) => table.rules(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// Smallest and largest exposure relative to that of the learning for which thresholds are scaled.
const EXPOSURES: (f64, f64) = (0.7, 1.4);

/// What was learned, for one camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThresholdTable {
    /// Width of the pictures, pixels, 16 to 8192.
    #[schemars(range(min = 16, max = 8192))]
    pub width: u32,
    /// Height of the pictures, pixels, 16 to 8192.
    #[schemars(range(min = 16, max = 8192))]
    pub height: u32,
    /// Vertical regions of a picture, 3 to 31.
    #[schemars(range(min = 3, max = 31))]
    pub regions: u32,
    /// Exposure of the pictures, relative to the camera's nominal one, 0.001 to 1000.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub exposure: f64,
    /// One for each place.
    #[serde(rename = "place")]
    #[schemars(length(max = 100_000))]
    pub places: Vec<Place>,
}

/// What was learned at one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Robot on the map, m, -1000000 to 1000000.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub x_m: f64,
    /// Robot on the map, m, -1000000 to 1000000.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub y_m: f64,
    /// Its heading, degrees, -360 to 360.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub heading_deg: f64,
    /// Threshold of edges, gray levels, 1 to 255.
    #[schemars(range(min = 1, max = 255))]
    pub t0: u8,
    /// Largest difference of any region at that threshold, pixels, 0 to 100000000.
    #[schemars(range(min = 0, max = 100_000_000))]
    pub n0: u32,
    /// Largest number of edges of any region that the map does not have, pixels, 0 to 100000000.
    #[schemars(range(min = 0, max = 100_000_000))]
    pub n0_extra: u32,
    /// Strongest upright step on the floor, gray levels, 0 to 255.
    #[schemars(range(min = 0.0, max = 255.0))]
    pub contrast: f64,
    /// Largest number of pixels of level edges of any region that the map does not have, 0 to 100000000, default 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100_000_000))]
    pub level: u32,
    /// Share of the map's edges that is seen at that threshold, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub recall: f64,
}

impl Place {
    /// The robot's pose on the map.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.x_m, self.y_m, self.heading_deg.to_radians())
    }

    /// The same for pictures of another exposure; `None` beyond 0.7 to 1.4 times that of the learning.
    #[must_use]
    pub fn exposed(&self, ratio: f64) -> Option<Place> {
        if !(EXPOSURES.0..=EXPOSURES.1).contains(&ratio) {
            return None;
        }
        let t0 = (f64::from(self.t0) * ratio).round().clamp(1.0, 255.0) as u8;
        Some(Place { t0, contrast: self.contrast * ratio, ..*self })
    }
}

impl ThresholdTable {
    /// Reads and checks the text of a table.
    ///
    /// # Errors
    /// Everything that is wrong in it, with its place.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        Self::parse("the thresholds", text)
    }

    /// Reads and checks a table.
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong in it, in words.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        Self::parse(&name, &text).map_err(|problems| problems.to_string())
    }

    /// Its text as a file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        use std::fmt::Write;
        let mut text = format!(
            "# Thresholds of edges by place, learned where nothing stood in the way.\n\n\
             # Pictures of this size (px), each 16 to 8192, in so many regions, 3 to 31.\n\
             width = {}\nheight = {}\nregions = {}\n\
             # Exposure relative to the camera's nominal one, 0.001 to 1000.\nexposure = {}\n\n\
             # Place on the map (m, m, degrees), threshold (gray levels), differing and unexplained pixels, strongest upright\n\
             # step on the floor (gray levels), pixels of level edges, share of the map's edges that is seen.\nplace = [\n",
            self.width, self.height, self.regions, self.exposure
        );
        for p in &self.places {
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "  {{ x_m = {:.3}, y_m = {:.3}, heading_deg = {:.2}, t0 = {}, n0 = {}, n0_extra = {}, \
                 contrast = {:.1}, level = {}, recall = {:.2} }},",
                p.x_m, p.y_m, p.heading_deg, p.t0, p.n0, p.n0_extra, p.contrast, p.level, p.recall
            );
        }
        text.push_str("]\n");
        text
    }

    /// What was learned nearest to `pose`, for pictures of the given exposure; `None` where nothing was learned near enough
    /// or the exposure differs too much.
    #[must_use]
    pub fn at(&self, pose: &Pose2, exposure: f64) -> Option<Place> {
        let place = self.places.get(nearest(self.places.iter().map(Place::pose), pose)?)?;
        place.exposed(exposure / self.exposure)
    }

    fn parse(name: &str, text: &str) -> Result<Self, Problems> {
        let table = THRESHOLD_FILE.read(name, text)?;
        let nothing = Self { width: 0, height: 0, regions: 0, exposure: 1.0, places: Vec::new() };
        Ok(table.try_into().unwrap_or(nothing))
    }

    fn rules(&self) -> Vec<BuildError> {
        let blind = self
            .places
            .iter()
            .enumerate()
            .filter(|(_, place)| place.recall < crate::threshold_learning::MIN_RECALL);
        let problem = "is too low: such a threshold does not see the map; leave the place out";
        blind.map(|(i, _)| BuildError::new(format!("place[{i}].recall"), problem)).collect()
    }
}
