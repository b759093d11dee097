//! The keys of an image sequence in a robot file.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::BuildError;
use yamabico_core::camera::{Calibration, IntrinsicsConfig, MountConfig};
use yamabico_core::message::{FrameHeader, Message};
use yamabico_core::sensor::{SensorInfo, SensorKind};

/// A device without keys of its own.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// Pictures from files in the place of a camera.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSequenceConfig {
    /// A folder (its .png, .jpg and .jpeg files), a pattern such as `drive/*.png`, or one file; relative to the robot
    /// file, or to the working directory on the command line. The order is that of the names.
    #[schemars(extend("format" = "path"))]
    pub files: String,
    /// Pictures a second, 0.1 to 1000, default 10.
    #[serde(default = "default_rate_hz")]
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rate_hz: f64,
    /// Time from the middle of the exposure to the picture's arrival, ms, 0 to 1000, default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// At the end begin again with the first picture, default false: the sequence ends.
    #[serde(default)]
    pub repeat: bool,
    /// Size and focal length; a picture of another size is refused.
    pub intrinsics: IntrinsicsConfig,
    /// Whether intrinsics and mount were measured, default guessed: then behaviors trust directions roughly and
    /// distances not at all.
    #[serde(default = "default_calibration")]
    pub calibration: Calibration,
    /// Where the camera sat on the robot.
    pub mount: MountConfig,
}

impl ImageSequenceConfig {
    /// What behaviors are told of the sensor `name`.
    ///
    /// # Errors
    /// Numbers that describe no camera or no rate.
    pub fn info(&self, name: &str) -> Result<SensorInfo, BuildError> {
        if !(0.1..=1000.0).contains(&self.rate_hz) {
            return Err(BuildError::new("rate_hz", format!("{} is not within 0.1 to 1000", self.rate_hz)));
        }
        if !(0.0..=1000.0).contains(&self.latency_ms) {
            return Err(BuildError::new(
                "latency_ms",
                format!("{} is not within 0 to 1000", self.latency_ms),
            ));
        }
        if !self.intrinsics.intrinsics().is_valid() {
            return Err(BuildError::new("intrinsics", "width, height and focal lengths must be above 0"));
        }
        Ok(SensorInfo {
            name: name.to_owned(),
            message: FrameHeader::NAME,
            period_s: 1.0 / self.rate_hz,
            latency_s: 1e-3 * self.latency_ms,
            kind: SensorKind::Camera {
                intrinsics: self.intrinsics.intrinsics(),
                distortion: self.intrinsics.distortion,
                mount: self.mount.into(),
                calibrated: self.calibration,
            },
        })
    }

    /// Bytes of one picture: a gray level a pixel.
    pub fn bytes(&self) -> usize {
        self.intrinsics.width as usize * self.intrinsics.height as usize
    }
}

fn default_rate_hz() -> f64 {
    10.0
}

fn default_calibration() -> Calibration {
    Calibration::Guessed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(text: &str) -> Result<ImageSequenceConfig, toml::de::Error> {
        toml::from_str(text)
    }

    #[test]
    fn little_needs_to_be_said() {
        let config =
            config("files = \"drive\"\nintrinsics = { width = 960, height = 540 }\nmount = { z_m = 0.3 }")
                .unwrap();
        let info = config.info("front").unwrap();
        assert_eq!((info.period_s, info.latency_s, config.bytes()), (0.1, 0.0, 960 * 540));
        let SensorKind::Camera { intrinsics, calibrated, .. } = info.kind else { panic!("no camera") };
        assert_eq!(calibrated, Calibration::Guessed);
        assert!((intrinsics.horizontal_fov().to_degrees() - 60.0).abs() < 1e-9);
    }

    #[test]
    fn wrong_keys_and_numbers_are_refused() {
        let size = "intrinsics = { width = 960, height = 540 }\nmount = { z_m = 0.3 }";
        assert!(config(size).unwrap_err().message().contains("files"));
        assert!(config(&format!("files = \"a\"\nrate = 3\n{size}")).unwrap_err().message().contains("rate"));
        for (key, line) in
            [("rate_hz", "rate_hz = 0"), ("latency_ms", "latency_ms = -1"), ("rate_hz", "rate_hz = nan")]
        {
            let config = config(&format!("files = \"a\"\n{line}\n{size}")).unwrap();
            assert_eq!(config.info("front").unwrap_err().key, key);
        }
        let flat =
            "files = \"a\"\nintrinsics = { width = 960, height = 540, fx = -1.0 }\nmount = { z_m = 0.3 }";
        assert_eq!(config(flat).unwrap().info("front").unwrap_err().key, "intrinsics");
    }

    #[test]
    fn the_schema_tells_units_and_ranges() {
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
