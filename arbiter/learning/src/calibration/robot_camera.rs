//! A camera in a robot file: reading it, and writing what was measured without touching comments and other keys.

use std::path::{Path, PathBuf};

use toml_edit::{DocumentMut, Item, Table};
use yamabico_core::camera::{Calibration, Distortion, IntrinsicsConfig, MountConfig, Pinhole};
use yamabico_core::plugins::Plugins;
use yamabico_parameters::quoted;
use yamabico_runtime::record::Contents;

use super::camera_keys::write_findings;
use crate::LearningError;

/// Name of a camera for which no robot file is given.
const DEFAULT_NAME: &str = "front";

/// Camera of a robot file, or an assumed one.
#[derive(Clone, Debug)]
pub struct RobotCamera {
    /// Robot file; `None` for an assumed camera.
    pub file: Option<PathBuf>,
    /// Name of the sensor.
    pub sensor: String,
    /// Lens and image.
    pub intrinsics: IntrinsicsConfig,
    /// Position and attitude.
    pub mount: MountConfig,
    /// Accuracy class.
    pub calibration: Calibration,
    /// Latency, ms, if the file or the driver says one.
    pub latency_ms: Option<f64>,
    /// True if the sensor has the parameter `calibration`.
    pub(super) has_class: bool,
}

/// Values that were measured.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Lens.
    pub lens: Option<Pinhole>,
    /// Row of the principal point, px.
    pub principal_row: Option<f64>,
    /// Height, m.
    pub height_m: Option<f64>,
    /// Downward tilt, degrees.
    pub tilt_deg: Option<f64>,
    /// Roll, degrees.
    pub roll_deg: Option<f64>,
    /// Pan, degrees.
    pub pan_deg: Option<f64>,
    /// Latency, ms.
    pub latency_ms: Option<f64>,
    /// True if lens and mount are measured now.
    pub is_complete: bool,
}

impl RobotCamera {
    /// Reads the camera `sensor` of a robot file, or its only pinhole camera.
    ///
    /// # Errors
    /// [`LearningError::Unsuitable`]: the file cannot be read, is no TOML, or has no such camera.
    pub fn read(file: &Path, sensor: Option<&str>, plugins: &Plugins) -> Result<Self, LearningError> {
        let text = std::fs::read_to_string(file).map_err(|error| {
            LearningError::Unsuitable(format!("robot file {} cannot be read: {error}", file.display()))
        })?;
        let camera = Self::of_text(&text, &file.display().to_string(), sensor, plugins)
            .map_err(LearningError::Unsuitable)?;
        Ok(Self { file: Some(file.to_owned()), ..camera })
    }

    /// Finds the camera in the robot files attached to a recording; `None` if none has it.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn of_recording(
        recording: &Path,
        sensor: Option<&str>,
        plugins: &Plugins,
    ) -> Result<Option<Self>, LearningError> {
        let contents = Contents::read(recording)?;
        let mut cameras =
            contents.files.iter().filter_map(|(name, text)| Self::of_text(text, name, sensor, plugins).ok());
        Ok(cameras.next_back())
    }

    /// Assumes a camera with pictures of this size and this horizontal field of view, degrees, at a height of 0.
    #[must_use]
    pub fn assumed([width, height]: [u32; 2], fov_deg: f64) -> Self {
        let (fx, fy, cx, cy) = (None, None, None, None);
        Self {
            file: None,
            sensor: DEFAULT_NAME.to_owned(),
            intrinsics: IntrinsicsConfig {
                width,
                height,
                fov_deg,
                fx,
                fy,
                cx,
                cy,
                distortion: Distortion::NONE,
            },
            mount: MountConfig::default(),
            calibration: Calibration::Guessed,
            latency_ms: None,
            has_class: true,
        }
    }

    /// Checks that pictures have the size that the camera states.
    ///
    /// # Errors
    /// [`LearningError::Unsuitable`].
    pub fn check_size(&self, name: &str, [width, height]: [u32; 2]) -> Result<(), LearningError> {
        let stated = &self.intrinsics;
        if [stated.width, stated.height] == [width, height] {
            return Ok(());
        }
        Err(LearningError::Unsuitable(format!(
            "{name} has {width} x {height} pixels, but the sensor `{}` has {} x {}: take pictures as the robot does, or correct `intrinsics`",
            self.sensor, stated.width, stated.height
        )))
    }

    /// Returns the findings as TOML for a robot file.
    #[must_use]
    pub fn toml(&self, findings: &Findings) -> String {
        let mut sensor = Table::new();
        write_findings(self, &mut sensor, findings);
        let mut sensors = Table::new();
        sensors.set_implicit(true);
        sensors.insert(&self.sensor, Item::Table(sensor));
        let mut document = DocumentMut::new();
        document.insert("sensors", Item::Table(sensors));
        document.to_string()
    }

    /// Writes the findings into a robot file that has this sensor; comments, order and all other keys stay.
    ///
    /// # Errors
    /// [`LearningError`].
    pub fn write(&self, file: &Path, findings: &Findings) -> Result<(), LearningError> {
        let unsuitable =
            |problem: String| LearningError::Unsuitable(format!("{}: {problem}", file.display()));
        let text =
            std::fs::read_to_string(file).map_err(|error| unsuitable(format!("cannot be read: {error}")))?;
        let mut document: DocumentMut =
            text.parse().map_err(|error| unsuitable(format!("is no TOML: {error}")))?;
        let sensor = document.get_mut("sensors").and_then(|sensors| sensors.get_mut(&self.sensor));
        let sensor = sensor.and_then(Item::as_table_like_mut);
        let sensor = sensor.ok_or_else(|| unsuitable(format!("has no sensor `{}`", self.sensor)))?;
        write_findings(self, sensor, findings);
        // A file that is cut off by a full disk would cost the robot: the new one replaces the old one at once.
        let new = file.with_extension("toml.new");
        let written = std::fs::write(&new, document.to_string()).and_then(|()| std::fs::rename(&new, file));
        written.map_err(|error| LearningError::write(file, error))
    }

    fn of_text(text: &str, name: &str, sensor: Option<&str>, plugins: &Plugins) -> Result<Self, String> {
        let tree: toml::Table =
            text.parse().map_err(|error: toml::de::Error| format!("{name} is no TOML: {error}"))?;
        let sensors = tree.get("sensors").and_then(toml::Value::as_table).cloned().unwrap_or_default();
        let is_camera =
            |table: &toml::Value| table.get("intrinsics").is_some_and(|lens| lens.get("width").is_some());
        let cameras: Vec<&str> =
            sensors.iter().filter(|(_, table)| is_camera(table)).map(|(name, _)| name.as_str()).collect();
        let hint = if tree.contains_key("include") {
            "; sensors of included parts are written there: name that file"
        } else {
            ""
        };
        let chosen = match sensor {
            Some(wanted) if cameras.contains(&wanted) => wanted,
            Some(wanted) if sensors.contains_key(wanted) => {
                return Err(format!(
                    "{name}: the sensor `{wanted}` is no pinhole camera with `intrinsics`; its cameras: {}",
                    listed(&cameras)
                ));
            }
            Some(wanted) => {
                return Err(format!(
                    "{name} has no sensor `{wanted}`; its cameras: {}{hint}",
                    listed(&cameras)
                ));
            }
            None => match cameras.as_slice() {
                [only] => only,
                [] => return Err(format!("{name} has no pinhole camera: a sensor with `intrinsics`{hint}")),
                several => {
                    return Err(format!(
                        "{name} has several cameras: name one with --sensor: {}",
                        listed(several)
                    ));
                }
            },
        };
        let table = &sensors[chosen];
        let part =
            |key: &str| table.get(key).cloned().unwrap_or_else(|| toml::Value::Table(toml::Table::new()));
        let refused = |key: &str, error: toml::de::Error| {
            format!("{name}: `{key}` of the sensor `{chosen}`: {}", error.message())
        };
        let intrinsics: IntrinsicsConfig =
            part("intrinsics").try_into().map_err(|error| refused("intrinsics", error))?;
        if !intrinsics.intrinsics().is_valid() {
            return Err(format!(
                "{name}: `intrinsics` of the sensor `{chosen}`: width, height and focal lengths must be above 0"
            ));
        }
        let mount: MountConfig = part("mount").try_into().map_err(|error| refused("mount", error))?;
        let device = table.get("device").and_then(toml::Value::as_str).unwrap_or_default();
        let driver = tree.get("devices").and_then(|devices| devices.get(device)?.get("driver")?.as_str());
        let kind = table.get("kind").and_then(toml::Value::as_str).unwrap_or_default();
        let driver = driver.and_then(|driver| plugins.driver(driver));
        let keys =
            driver.and_then(|driver| driver.info().sensor(kind).map(|offer| &offer.parameters["properties"]));
        let latency_ms = table.get("latency_ms").and_then(number);
        let default_ms = || keys.and_then(|keys| keys["latency_ms"]["default"].as_f64());
        let class = table.get("calibration").and_then(toml::Value::as_str);
        Ok(Self {
            file: None,
            sensor: chosen.to_owned(),
            intrinsics,
            mount,
            // A camera without this parameter, as that of the simulator, knows its lens and its mount.
            calibration: match class {
                Some("measured") => Calibration::Measured,
                None if keys.is_some_and(|keys| keys.get("calibration").is_none()) => Calibration::Measured,
                _ => Calibration::Guessed,
            },
            latency_ms: latency_ms.or_else(default_ms),
            has_class: class.is_some() || keys.is_some_and(|keys| keys.get("calibration").is_some()),
        })
    }
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { quoted(names) }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|value| value as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "# A robot.\n[devices.camera]\ndriver = \"x\"\n\n[sensors.front]\ndevice = \"camera\"\nkind = \"http\"  # the phone\nlatency_ms = 60   # measured once\n\
        intrinsics = { width = 640, height = 480, fov_deg = 60 } # a guess\nmount = { x_m = 0.15, z_m = 0.4, tilt_deg = 15 }\n\n[sensors.sonar]\nkind = \"lidar\"\n";

    #[test]
    fn findings_are_written_between_comments() {
        let plugins = Plugins::default();
        let camera = RobotCamera::of_text(FILE, "robot.toml", None, &plugins).unwrap();
        assert_eq!(
            (camera.sensor.as_str(), camera.latency_ms, camera.mount.x_m),
            ("front", Some(60.0), 0.15)
        );
        let file = std::env::temp_dir().join(format!("yamabico-robot-camera-{}.toml", std::process::id()));
        std::fs::write(&file, FILE).unwrap();
        let findings = Findings {
            principal_row: Some(431.04),
            tilt_deg: Some(14.237),
            height_m: Some(0.3921),
            latency_ms: Some(83.0),
            ..Findings::default()
        };
        camera.write(&file, &findings).unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::remove_file(&file).unwrap();
        for part in [
            "# A robot.",
            "kind = \"http\"  # the phone",
            "latency_ms = 83.0   # measured once",
            "fov_deg = 60, cy = 431.0 } # a guess",
            "mount = { x_m = 0.15, z_m = 0.392, tilt_deg = 14.24 }",
            "[sensors.sonar]\nkind = \"lidar\"\n",
        ] {
            assert!(text.contains(part), "`{part}` is missing in\n{text}");
        }
        let pasted: toml::Table = camera.toml(&findings).parse().unwrap();
        assert_eq!(pasted["sensors"]["front"]["mount"]["z_m"].as_float(), Some(0.392));
    }

    #[test]
    fn a_robot_file_without_such_a_sensor_is_refused() {
        let refusal = |sensor: Option<&str>, text: &str| {
            RobotCamera::of_text(text, "robot.toml", sensor, &Plugins::default()).unwrap_err()
        };
        assert!(refusal(Some("rear"), FILE).contains("no sensor `rear`; its cameras: `front`"));
        assert!(refusal(Some("sonar"), FILE).contains("`sonar` is no pinhole camera"));
        assert!(refusal(None, "include = [\"parts/a.toml\"]").contains("name that file"));
        assert!(refusal(None, "name = ").contains("is no TOML"));
    }
}
