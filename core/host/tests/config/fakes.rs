//! Small plugins to name in configurations; they do nothing.

use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::{
    Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::driver::{
    Device, DeviceSpec, DriveOffer, Driver, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{
    Axes, FrameHeader, Goal, Odometry, Pose, Proposal, RangeScanHeader, Reason, Truth,
};
use yamabico_core::parameters::{FileKind, Problems, read, schema_of};
use yamabico_core::plugins::Plugins;
use yamabico_core::testing::{FakeDriver, NoParameters, plain_sensor};
use yamabico_host::config::{Overrides, Task, load};

pub fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![
            factory::<Follower>(),
            factory::<Halt>(),
            factory::<Strafer>(),
            factory::<Localizer>(),
        ],
        drivers: vec![sim(), FakeDriver::new("bench", unopened).shared()],
    }
}

pub fn check(path: &str) -> Result<Task, Problems> {
    load(Path::new(path), &Overrides::default(), &plugins())
}

const CAMERA: Slot<FrameHeader> = Slot::required("camera", "The camera that looks ahead.");
const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "The sonars at the front.");
const POSE: Slot<Pose> = Slot::optional("pose", "Where the robot is.");
const WHEELS: Slot<Odometry> = Slot::required("odometry", "The wheels.");

/// Follows a wall.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FollowerConfig {
    /// Speed along the corridor.
    #[schemars(range(min = 0.05, max = 2.0))]
    speed_mps: f64,
    /// Which wall to keep to.
    side: Side,
    /// Weights of the last three headings. Newest first.
    #[schemars(length(min = 3, max = 3))]
    weights: Vec<f64>,
    /// Search for a lost wall.
    search: Option<Search>,
    /// Maximum number of consecutive frames without a wall.
    patience: u32,
}

impl Default for FollowerConfig {
    fn default() -> Self {
        FollowerConfig {
            speed_mps: 0.4,
            side: Side::Center,
            weights: vec![0.5, 0.3, 0.2],
            search: None,
            patience: 5,
        }
    }
}

/// Which wall to keep to.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Side {
    Left,
    Center,
    Right,
}

/// Search for a lost wall.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Search {
    /// Turn rate while looking.
    #[schemars(range(min = 0.01, max = 2.0))]
    turn_radps: f64,
    /// Half of the angle that is searched.
    #[schemars(range(min = 1.0, max = 180.0))]
    sweep_deg: f64,
}

pub struct Follower;

impl Behavior for Follower {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::abstain(Reason::NoInput)
    }
}

impl Plugin for Follower {
    type Config = FollowerConfig;
    const NAME: &'static str = "wall-follower";
    const SUMMARY: &'static str = "Drives along a corridor.";
    const INPUTS: &'static [SlotInfo] = &[CAMERA.info(), POSE.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: FollowerConfig, setup: &Setup) -> Result<Self, ParameterError> {
        let most = setup.robot.limits.speed[0];
        if config.speed_mps > most {
            let problem =
                format!("must be at most this robot's {most} m/s, but is {} m/s: lower it", config.speed_mps);
            return Err(ParameterError::new("speed_mps", problem));
        }
        if config.search.is_some_and(|search| search.sweep_deg > 90.0 && search.turn_radps > 1.0) {
            return Err(ParameterError::new(
                "search.sweep_deg",
                "a wide sweep needs a slow turn; at most 90",
            ));
        }
        let sum: f64 = config.weights.iter().sum();
        if sum <= 0.0 {
            return Err(ParameterError::new("weights", "the sum must be positive"));
        }
        let _ = (config.side, config.patience);
        Ok(Follower)
    }
}

/// Halts.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HaltConfig {
    /// An echo nearer than this halts.
    #[schemars(range(min = 0.05, max = 10.0))]
    gate_m: f64,
    /// Clean readings in a row that release.
    #[serde(default = "three")]
    #[schemars(range(min = 1, max = 100))]
    clean: u32,
}

fn three() -> u32 {
    3
}

pub struct Halt;

impl Behavior for Halt {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::abstain(Reason::NoInput)
    }
}

impl Plugin for Halt {
    type Config = HaltConfig;
    const NAME: &'static str = "sonar-halt";
    const SUMMARY: &'static str = "Halts before what the sonars see.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: HaltConfig, _: &Setup) -> Result<Self, ParameterError> {
        let _ = (config.gate_m, config.clean);
        Ok(Halt)
    }
}

pub struct Strafer;

impl Behavior for Strafer {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::abstain(Reason::NoInput)
    }
}

impl Plugin for Strafer {
    type Config = NoParameters;
    const NAME: &'static str = "strafer";
    const SUMMARY: &'static str = "Evades sideways.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::LATERAL;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Strafer)
    }
}

/// Keeps a map.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LocalizerConfig {
    /// Features to match.
    #[serde(rename = "match")]
    matching: Match,
    /// The file of what is known.
    #[schemars(extend("format" = "file"))]
    map: Option<String>,
    /// Corners of the route.
    #[serde(default)]
    #[schemars(extend("format" = "map-positions"))]
    #[allow(dead_code, reason = "for the schema")]
    route: Vec<[f64; 2]>,
}

/// A map.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapFile {
    /// Length of the map.
    #[schemars(range(min = 1.0, max = 200.0))]
    #[allow(dead_code, reason = "for the schema")]
    length_m: f64,
}

/// Features to match.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Match {
    /// Vertical edges.
    Edges {
        /// Smallest contrast.
        #[schemars(range(min = 1, max = 255))]
        contrast: u8,
    },
    /// Corners.
    Corners {
        /// Number of corners.
        #[schemars(range(min = 1, max = 1000))]
        count: u32,
    },
}

pub struct Localizer;

impl Behavior for Localizer {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::abstain(Reason::NoInput)
    }
}

impl Plugin for Localizer {
    type Config = LocalizerConfig;
    const NAME: &'static str = "localizer";
    const SUMMARY: &'static str = "Finds the robot on its map.";
    const INPUTS: &'static [SlotInfo] = &[
        WHEELS.info(),
        Slot::<Pose>::optional("prior", "A guess.").info(),
        Slot::<Goal>::optional("goal", "Where to go.").info(),
    ];
    const FILES: &'static [FileKind] = &[FileKind {
        key: "map",
        what: "a map file",
        schema: || schemars::schema_for!(MapFile),
        rules: |_| Vec::new(),
    }];
    const OUTPUTS: &'static [SlotInfo] = &[Slot::<Pose>::required("pose", "Where the robot is.").info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: LocalizerConfig, setup: &Setup) -> Result<Self, ParameterError> {
        if let Some(map) = config.map.filter(|map| !setup.folder.join(map).is_file()) {
            return Err(ParameterError::new(
                "map",
                format!("there is no {map} in {}", setup.folder.display()),
            ));
        }
        match config.matching {
            Match::Edges { contrast } => _ = contrast,
            Match::Corners { count } => _ = count,
        }
        Ok(Localizer)
    }
}

/// Parameters of a simulated world.
#[derive(Debug, Deserialize, JsonSchema)]
struct SimConfig {
    /// The world file.
    #[schemars(extend("format" = "file"))]
    #[allow(dead_code, reason = "for the schema")]
    world: String,
}

/// A world.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct World {
    /// Length of the hallway.
    #[schemars(range(min = 1.0, max = 200.0))]
    length_m: f64,
    /// Doors.
    #[serde(rename = "door")]
    doors: Vec<Door>,
}

/// A door.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Door {
    /// Along the hallway.
    #[schemars(range(min = 0.0, max = 200.0))]
    at_m: f64,
}

/// Parameters of a camera.
#[derive(Debug, Deserialize, JsonSchema)]
struct CameraConfig {
    /// Pictures a second.
    #[schemars(range(min = 0.1, max = 200.0))]
    rate_hz: f64,
    /// Width of a picture.
    #[schemars(range(min = 16, max = 4096))]
    width_px: u32,
    /// From the middle of the exposure to delivery.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    latency_ms: f64,
    /// A picture that is black where nothing is to be seen.
    mask: Option<String>,
    /// Horizontal field of view.
    #[serde(default = "ninety")]
    #[schemars(range(min = 10.0, max = 170.0))]
    #[allow(dead_code, reason = "for the schema")]
    fov_deg: f64,
}

fn ninety() -> f64 {
    90.0
}

/// Parameters of any other sensor.
#[derive(Debug, Deserialize, JsonSchema)]
struct PeriodConfig {
    /// From one measurement to the next.
    #[serde(default = "fifty")]
    #[schemars(range(min = 1.0, max = 10000.0))]
    period_ms: f64,
}

fn fifty() -> f64 {
    50.0
}

fn sim() -> Arc<dyn Driver> {
    let world = FileKind {
        key: "world",
        what: "a world file",
        schema: || schemars::schema_for!(World),
        rules: |table| {
            let world: World = read(table).unwrap_or_default();
            let outside = world.doors.iter().enumerate().filter(|(_, door)| door.at_m > world.length_m);
            outside
                .map(|(i, _)| ParameterError::new(format!("door[{i}].at_m"), "lies beyond the far end"))
                .collect()
        },
    };
    let sensors = vec![
        SensorOffer::new::<FrameHeader, CameraConfig>("camera", "A pinhole camera."),
        SensorOffer::new::<RangeScanHeader, PeriodConfig>("sonar-ring", "Sonars."),
        SensorOffer::new::<Odometry, PeriodConfig>("wheels", "Wheel encoders."),
        SensorOffer::new::<Truth, PeriodConfig>("truth", "The judge's truth."),
    ];
    let drive = DriveOffer::new::<NoParameters>("differential", "Two wheels.", Axes::PLANAR);
    let driver = FakeDriver::new("sim", unopened).with(|info| {
        info.summary = "A simulated robot.".into();
        info.parameters = schema_of::<SimConfig>();
        info.files = vec![world];
        (info.sensors, info.drives) = (sensors, vec![drive]);
    });
    driver.describing(describe).checking(check_sensor).shared()
}

fn describe(sensor: &PartSpec) -> Result<SensorDescription, ParameterError> {
    if sensor.kind != "camera" {
        let period_s = read::<PeriodConfig>(&sensor.table)?.period_ms * 1e-3;
        return Ok(plain_sensor::<RangeScanHeader>(&sensor.name, period_s, 4096));
    }
    let config: CameraConfig = read(&sensor.table)?;
    if config.width_px % 2 == 1 {
        let problem = format!("{} is odd; take an even number", config.width_px);
        return Err(ParameterError::new("width_px", problem));
    }
    let bytes = config.width_px as usize * 480;
    let mut description = plain_sensor::<FrameHeader>(&sensor.name, 1.0 / config.rate_hz, bytes);
    description.info.latency_s = config.latency_ms * 1e-3;
    Ok(description)
}

fn check_sensor(sensor: &PartSpec, folder: &Path) -> Result<(), ParameterError> {
    if sensor.kind != "camera" {
        return Ok(());
    }
    match &read::<CameraConfig>(&sensor.table)?.mask {
        Some(mask) if !folder.join(mask).is_file() => {
            Err(ParameterError::new("mask", format!("there is no image {mask}")))
        }
        _ => Ok(()),
    }
}

fn unopened(_: DeviceSpec) -> Result<Device, ParameterError> {
    Err(ParameterError::new("", "cannot be opened"))
}
