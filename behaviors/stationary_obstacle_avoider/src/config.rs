//! Parameters of the behavior.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_vision::map::WireFrame;

use crate::threshold_table::ThresholdTable;
use crate::{CAMERA, CORRIDOR, PATH, POSE};

/// Way of avoiding obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Evidence of the floor's color, of motion and of sonars in a grid around the robot; drives the best lane beside the
    /// path.
    #[default]
    Lanes,
    /// Ohya, Kosaka & Kak (1998): compares edges with the map and with learned thresholds, halts for echoes, looks, and
    /// turns to a passage.
    Passages,
}

/// Parameters of [`StationaryObstacleAvoider`](crate::StationaryObstacleAvoider).
#[serde_inline_default]
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Method: evidence in a grid and lanes beside the path, or edges against the map and passages.
    #[serde(default)]
    pub method: Method,
    /// Path of the map file, relative to the task file; needs the inputs `pose` and `path`. Without it the input
    /// `corridor` takes their place.
    #[serde(default)]
    #[schemars(extend("format" = "file"))]
    pub map: Option<String>,
    /// Method `passages`: path of the table of learned thresholds, relative to the task file. Where none were learned within
    /// 1 m, or with images of another size, only edges on the floor show obstacles.
    #[serde(default)]
    #[schemars(extend("format" = "file"))]
    pub thresholds: Option<String>,
    /// Method `passages`: if set, a place without learned thresholds counts as not observed, and the speed is limited to
    /// `blind_speed_mps` there.
    #[serde(default)]
    pub requires_thresholds: bool,
    /// Method `passages`: if set, the motion of the floor between frames tells things from joints, shadows and mirror images: edges on
    /// proven floor are ignored, and things are found without thresholds. Has no effect with a lens that distorts.
    #[serde(default)]
    pub plane_motion: bool,
    /// Method `lanes`: if set, the floor's color and texture show where it ends and where it was seen.
    #[serde_inline_default(true)]
    pub uses_look: bool,
    /// Method `lanes`: if set, upright edges and motion between frames show things.
    #[serde_inline_default(true)]
    pub uses_geometry: bool,
    /// Speed while avoiding an obstacle; method `lanes`: 0.7 of it where there is little room beside the robot; method `passages`: at most
    /// 0.25 m/s.
    #[serde_inline_default(0.35)]
    #[schemars(range(min = 0.02, max = 1.0))]
    pub speed_mps: f64,
    /// Speed limit while vision gives no result.
    #[serde_inline_default(0.1)]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub blind_speed_mps: f64,
    /// Maximum turn rate.
    #[serde_inline_default(0.7)]
    #[schemars(range(min = 0.1, max = 3.0), extend("former_name" = "largest_turn_radps"))]
    pub max_turn_radps: f64,
    /// Clearance kept on both sides of the robot's circle.
    #[serde_inline_default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub margin_m: f64,
    /// Method `passages`: additional clearance in a gap that is wide enough for it, so that the sonar's gate stays clear.
    #[serde_inline_default(0.1)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gap_margin_m: f64,
    /// Range below which an echo halts the robot, measured from the sensor.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// Age of the newest scan above which the sonar counts as an echo.
    #[serde_inline_default(300.0)]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Method `passages`: distance driven along the path after which an obstacle behind the robot counts as passed.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub passing_m: f64,
    /// Method `passages`: time after which a blocked robot searches for a passage again.
    #[serde_inline_default(10.0)]
    #[schemars(range(min = 1.0, max = 600.0))]
    pub retry_s: f64,
    /// Method `passages`: fraction by which a difference of edges may exceed the learned one.
    #[serde_inline_default(0.5)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub epsilon: f64,
}

impl Config {
    /// Checks that the inputs give the robot a frame: pose and path on a map, or a corridor.
    ///
    /// # Errors
    /// Inputs or files are missing, or contradict each other.
    pub(crate) fn check_guidance(&self, setup: &Setup) -> Result<(), ParameterError> {
        let refused =
            |key: &str, problem: &str, remedy: &str| Err(ParameterError::new(key, problem).remedy(remedy));
        let missing = |slot: &str| {
            let remedy = "connect a map-localizer, such as inputs = { pose = \"map-localizer.pose\", \
                          path = \"map-localizer.path\" }";
            refused(&format!("inputs.{slot}"), "is not connected, but `map` needs pose and path", remedy)
        };
        let is_connected = |name: &str| setup.connected.iter().flatten().any(|connected| connected == name);
        if self.map.is_some() {
            return match (setup.is_empty(&POSE), setup.is_empty(&PATH)) {
                (true, _) => missing(POSE.name),
                (_, true) => missing(PATH.name),
                _ if is_connected(CORRIDOR.name) => {
                    refused("inputs.corridor", "has no use with `map`", "remove one of the two")
                }
                _ => Ok(()),
            };
        }
        if setup.is_empty(&CORRIDOR) {
            let remedy = "name a map and connect the inputs pose and path, or connect the input corridor, such as \
                          inputs = { corridor = \"wall-follower.corridor\" }";
            return refused("map", "is missing", remedy);
        }
        if let Some(slot) = [POSE.name, PATH.name].into_iter().find(|name| is_connected(name)) {
            let (key, remedy) = (format!("inputs.{slot}"), "name the map, or remove the input");
            return refused(&key, "has no use without `map`", remedy);
        }
        match self.thresholds {
            Some(_) => refused("thresholds", "were learned on a map", "name the map, or remove the key"),
            None => Ok(()),
        }
    }

    /// Reads the map; without one it is empty.
    ///
    /// # Errors
    /// The file cannot be used.
    pub(crate) fn read_map(&self, setup: &Setup) -> Result<WireFrame, ParameterError> {
        match &self.map {
            Some(file) => WireFrame::read(&setup.folder.join(file))
                .map_err(|error| ParameterError::new("map", error.to_string())),
            None => Ok(WireFrame::default()),
        }
    }

    /// Reads the thresholds; `None` if no file is set, or if it is for images of another size than `size` (width, height, px), as of
    /// another robot.
    ///
    /// # Errors
    /// The file cannot be used, or the behavior requires thresholds that it does not hold.
    pub(crate) fn read_thresholds(
        &self,
        setup: &Setup,
        size: [u32; 2],
    ) -> Result<Option<ThresholdTable>, ParameterError> {
        let Some(file) = &self.thresholds else { return Ok(None) };
        let table = ThresholdTable::read(&setup.folder.join(file))
            .map_err(|error| ParameterError::new("thresholds", error))?;
        match unlike(&table, size) {
            Some(problem) if self.requires_thresholds => {
                Err(ParameterError::new("thresholds", format!("{problem}: learn them again")))
            }
            unlike => Ok(unlike.is_none().then_some(table)),
        }
    }

    /// Returns what people should know: keys without effect, and what becomes of the thresholds.
    pub(crate) fn notes(&self, setup: &Setup) -> Vec<String> {
        let [lanes, passages] = [Method::Lanes, Method::Passages];
        let keys = [
            (self.thresholds.is_some(), "thresholds", passages),
            (self.plane_motion, "plane_motion", passages),
            (self.requires_thresholds, "requires_thresholds", passages),
            (!self.uses_look, "uses_look", lanes),
            (!self.uses_geometry, "uses_geometry", lanes),
        ];
        let unused = keys.into_iter().filter(|(is_set, _, user)| *is_set && *user != self.method);
        let unused = unused.map(|(_, key, user)| {
            let user = if user == lanes { "lanes" } else { "passages" };
            format!("`{key}` has no effect: only method = \"{user}\" uses it")
        });
        let thresholds = (self.method == passages).then(|| self.threshold_note(setup)).flatten();
        unused.chain(thresholds).collect()
    }

    /// Returns what the robot does without usable thresholds; `None` if it has some.
    fn threshold_note(&self, setup: &Setup) -> Option<String> {
        let effect = match self.requires_thresholds {
            true => {
                format!("it drives at most at {} m/s, and detects nothing by vision", self.blind_speed_mps)
            }
            false => "only edges on the floor show obstacles".to_owned(),
        };
        let learn = "learn thresholds with `yamabico learn thresholds`";
        self.map.as_ref()?;
        let Some(file) = &self.thresholds else { return Some(format!("no thresholds: {effect}; {learn}")) };
        let table = ThresholdTable::read(&setup.folder.join(file)).ok()?;
        let camera = setup.pinhole(&CAMERA).ok().map(|camera| *camera.pinhole.intrinsics());
        let unlike = camera.and_then(|camera| unlike(&table, [camera.width, camera.height]));
        let unlike = unlike.map(|problem| format!("the thresholds in {file} {problem}"));
        let is_empty = table.places.is_empty().then(|| format!("{file} holds no place"));
        unlike.or(is_empty).map(|problem| format!("{problem}: {effect}; {learn}"))
    }
}

/// Says that thresholds were learned with images of another size than `[width, height]`, pixels; `None` if they were not.
fn unlike(table: &ThresholdTable, [width, height]: [u32; 2]) -> Option<String> {
    let is_like = (table.width, table.height) == (width, height);
    (!is_like).then(|| {
        format!(
            "were learned with images of {} x {} pixels, but the camera has {width} x {height}",
            table.width, table.height
        )
    })
}
