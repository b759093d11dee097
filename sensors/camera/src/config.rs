//! Parameters of an image sequence in a robot file.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};
use yamabico_core::message::Encoding;

use crate::description::CameraDescription;

/// Empty parameters, of a device or drive without any.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// Parameters of an image sequence: frames from files instead of a camera.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSequenceConfig {
    /// Folder (its .png, .jpg and .jpeg files), pattern such as `drive/*.png`, or single file; relative to the robot
    /// file, or to the working directory on the command line. Files are read in the order of their names.
    #[schemars(extend("format" = "path"))]
    pub files: String,
    /// Times of capture: `rate` for a constant rate; `names` where the name of each file is its time (seconds with a point, or ms,
    /// us or ns since 1970); or the path of a CSV table with the name and the time of each file, relative like `files`.
    #[serde_inline_default(crate::stamps::RATE.to_owned())]
    pub stamps: String,
    /// Frame rate; with `stamps`, the nominal one.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Delay from the middle of the exposure to the delivery of a frame.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// If set, the sequence restarts at its end; otherwise the sensor ends.
    #[serde(default)]
    pub repeat: bool,
    /// Image size, focal length and principal point; files of another size are refused.
    pub intrinsics: IntrinsicsConfig,
    /// Accuracy of intrinsics and mount. If guessed, behaviors treat directions as approximate and do not use
    /// distances.
    #[serde_inline_default(Calibration::Guessed)]
    pub calibration: Calibration,
    /// Pose on the robot.
    pub mount: MountConfig,
}

impl ImageSequenceConfig {
    /// Returns the parameters that cameras of all kinds share.
    #[must_use]
    pub fn description(&self) -> CameraDescription {
        CameraDescription {
            rate_hz: self.rate_hz,
            latency_ms: self.latency_ms,
            encoding: Encoding::Gray8,
            intrinsics: self.intrinsics,
            calibration: self.calibration,
            mount: self.mount,
        }
    }
}

#[cfg(test)]
mod tests {
    use yamabico_core::sensor::SensorKind;

    use super::*;

    fn config(text: &str) -> Result<ImageSequenceConfig, toml::de::Error> {
        toml::from_str(text)
    }

    #[test]
    fn defaults_are_complete() {
        let config =
            config("files = \"drive\"\nintrinsics = { width = 960, height = 540 }\nmount = { z_m = 0.3 }")
                .unwrap();
        let info = config.description().info("front").unwrap();
        assert_eq!((info.period_s, info.latency_s, config.description().bytes()), (0.1, 0.0, 960 * 540));
        let SensorKind::Camera { intrinsics, calibrated, .. } = info.kind else { panic!("no camera") };
        assert_eq!(calibrated, Calibration::Guessed);
        assert!((intrinsics.horizontal_fov().to_degrees() - 60.0).abs() < 1e-9);
    }

    #[test]
    fn wrong_keys_and_cameras_are_refused() {
        let size = "intrinsics = { width = 960, height = 540 }\nmount = { z_m = 0.3 }";
        assert!(config(size).unwrap_err().message().contains("files"));
        assert!(config(&format!("files = \"a\"\nrate = 3\n{size}")).unwrap_err().message().contains("rate"));
        let flat =
            "files = \"a\"\nintrinsics = { width = 960, height = 540, fx = -1.0 }\nmount = { z_m = 0.3 }";
        assert_eq!(config(flat).unwrap().description().info("front").unwrap_err().key, "intrinsics");
    }

    #[test]
    fn the_schema_has_ranges_and_descriptions() {
        let schema = schemars::schema_for!(ImageSequenceConfig).to_value();
        let rate = &schema["properties"]["rate_hz"];
        assert_eq!(
            (&rate["minimum"], &rate["maximum"], &rate["default"]),
            (&0.1.into(), &1000.0.into(), &10.0.into())
        );
        let properties = schema["properties"].as_object().unwrap();
        assert!(properties.values().all(|key| key["description"].is_string()), "every key is described");
        assert_eq!(schema["properties"]["calibration"]["default"], "guessed");
    }
}
