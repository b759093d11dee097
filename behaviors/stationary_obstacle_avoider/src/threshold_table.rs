//! Table of the thresholds learned in a building, a TOML file: the differences between frames and map at each place
//! without obstacles.

use std::path::Path;

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::ParameterError;
use yamabico_core::geometry::Pose2;
use yamabico_core::parameters::{FileKind, Problems};

use crate::obstacle_regions::{MAX_DISTANCE_M, nearest};

/// File kind of threshold tables.
pub const THRESHOLD_FILE: FileKind = FileKind {
    key: "thresholds",
    what: "a table of thresholds",
    schema: || schema_for!(ThresholdTable),
    rules: |table| match table.clone().try_into::<ThresholdTable>() {
        Ok(table) => table.rules(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Minimum and maximum exposure, relative to that of the learning, for which thresholds are scaled.
const EXPOSURES: (f64, f64) = (0.7, 1.4);

/// Threshold of edge strength where none was learned, gray levels.
const UNLEARNED_T0: u8 = 10;
/// Strongest vertical step on a floor without obstacles that was not learned, gray levels.
const UNLEARNED_CONTRAST: f64 = 7.0;

/// Thresholds learned for one camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThresholdTable {
    /// Image width, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub width: u32,
    /// Image height, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub height: u32,
    /// Number of vertical regions of the image.
    #[schemars(range(min = 3, max = 31))]
    pub regions: u32,
    /// Exposure of the images, relative to the camera's nominal exposure.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub exposure: f64,
    /// Learned thresholds, one entry per robot pose.
    #[serde(rename = "place")]
    #[schemars(length(max = 100_000))]
    pub places: Vec<Place>,
}

/// Thresholds learned at one pose of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Robot x in the map frame.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub x_m: f64,
    /// Robot y in the map frame.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub y_m: f64,
    /// Robot heading in the map frame.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub heading_deg: f64,
    /// Threshold of edge strength, gray levels.
    #[schemars(range(min = 1, max = 255))]
    pub t0: u8,
    /// Maximum difference of edges in any region at that threshold, pixels.
    #[schemars(range(min = 0, max = 100_000_000))]
    pub n0: u32,
    /// Maximum number of edges in any region that are missing from the map, pixels.
    #[schemars(range(min = 0, max = 100_000_000))]
    pub n0_extra: u32,
    /// Strongest vertical brightness step on the floor, gray levels.
    #[schemars(range(min = 0.0, max = 255.0))]
    pub contrast: f64,
    /// Maximum number of horizontal edges in any region that are missing from the map, pixels.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100_000_000))]
    pub level: u32,
    /// Fraction of the map's edges that are detected at that threshold.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub recall: f64,
}

impl Place {
    /// Returns the thresholds of a place where none were learned: edges on the bare floor count, but not those above it,
    /// which a map lacks where it lacks details.
    #[must_use]
    pub const fn unlearned() -> Place {
        Place {
            x_m: 0.0,
            y_m: 0.0,
            heading_deg: 0.0,
            t0: UNLEARNED_T0,
            n0: 0,
            n0_extra: u32::MAX,
            contrast: UNLEARNED_CONTRAST,
            level: 0,
            recall: 1.0,
        }
    }

    /// Returns true for [`Place::unlearned`].
    #[must_use]
    pub const fn is_unlearned(&self) -> bool {
        self.n0_extra == u32::MAX
    }

    /// Returns the pose of the robot, map frame.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.x_m, self.y_m, self.heading_deg.to_radians())
    }

    /// Returns the thresholds scaled to an exposure of `ratio` times that of the learning; `None` outside 0.7 to 1.4.
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
    /// Parses and checks the text of a table.
    ///
    /// # Errors
    /// All problems in the text, with their positions.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        Self::parse("the thresholds", text)
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// The reason why the file cannot be read, or all problems in it, as text.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        Self::parse(&name, &text).map_err(|problems| problems.to_string())
    }

    /// Returns the table as TOML text.
    #[must_use]
    pub fn to_toml(&self) -> String {
        use std::fmt::Write;
        let mut text = format!(
            "# Edge thresholds by place, learned in the building without obstacles.\n\n\
             # Image size (px, 16 to 8192), and number of vertical regions (3 to 31).\n\
             width = {}\nheight = {}\nregions = {}\n\
             # Exposure relative to the camera's nominal exposure, 0.001 to 1000.\nexposure = {}\n\n\
             # Pose (m, m, degrees), threshold (gray levels), differing and unexplained pixels, strongest vertical step on\n\
             # the floor (gray levels), horizontal edge pixels, fraction of the map's edges that is detected.\nplace = [\n",
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

    /// Returns the thresholds learned nearest to `pose`, scaled to `exposure` (relative to the camera's nominal one);
    /// `None` if nothing was learned near enough or the exposure differs too much.
    #[must_use]
    pub fn at(&self, pose: &Pose2, exposure: f64) -> Option<Place> {
        let place = self.places.get(nearest(self.places.iter().map(Place::pose), pose)?)?;
        place.exposed(exposure / self.exposure)
    }

    /// Returns true if thresholds were learned near the position of `pose`, in whatever heading and exposure.
    #[must_use]
    pub fn is_near(&self, pose: &Pose2) -> bool {
        self.places.iter().any(|place| place.pose().distance(pose) <= MAX_DISTANCE_M)
    }

    fn parse(name: &str, text: &str) -> Result<Self, Problems> {
        let table = THRESHOLD_FILE.read(name, text)?;
        let empty = Self { width: 0, height: 0, regions: 0, exposure: 1.0, places: Vec::new() };
        Ok(table.try_into().unwrap_or(empty))
    }

    fn rules(&self) -> Vec<ParameterError> {
        let blind = self
            .places
            .iter()
            .enumerate()
            .filter(|(_, place)| place.recall < crate::threshold_learning::MIN_RECALL);
        let problem =
            "is too low: with this threshold most edges of the map are not detected; remove the entry";
        blind.map(|(i, _)| ParameterError::new(format!("place[{i}].recall"), problem)).collect()
    }
}
