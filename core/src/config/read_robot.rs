//! From the tree of a robot file to what is known of the robot.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::document::{Entry, Node, Table, Value};
use super::nearest::instead;
use super::places::refusal;
use super::plugins::Plugins;
use super::problem::{Problem, Span};
use super::robot::{DeviceFile, DriveFile, RobotFile, SensorFile};
use super::schema_check::{Shape, check_table};
use super::tables::{DeviceKeys, LimitsKeys, PartKeys, RobotKeys};
use crate::message::{Axes, Axis};
use crate::sensor::{DriverPlugin, MotionLimits, PartSpec, Robot, SensorInfo, SensorPlugin};

/// What could be read of a robot file; behaviours are checked against it even where a part is wrong.
pub(crate) struct RobotDraft {
    pub path: PathBuf,
    pub robot: Robot,
    pub devices: Vec<DeviceFile>,
    pub sensors: Vec<SensorDraft>,
    pub drive: Option<DriveFile>,
}

/// What could be read of a sensor.
pub(crate) struct SensorDraft {
    pub name: String,
    pub span: Span,
    pub plugin: Option<&'static SensorPlugin>,
    pub info: Option<SensorInfo>,
    pub file: Option<SensorFile>,
}

impl RobotDraft {
    /// The checked file; none where a part is missing.
    pub fn finish(self) -> Option<RobotFile> {
        let sensors: Option<Vec<SensorFile>> = self.sensors.into_iter().map(|sensor| sensor.file).collect();
        Some(RobotFile {
            path: self.path,
            robot: self.robot,
            devices: self.devices,
            sensors: sensors?,
            drive: self.drive?,
        })
    }
}

/// Reads the tree of source number `source`.
pub(crate) fn read_robot(
    path: &Path,
    source: usize,
    tree: &Table,
    plugins: &Plugins<'_>,
    problems: &mut Vec<Problem>,
) -> RobotDraft {
    let keys: RobotKeys = read_keys(tree, Span { source, start: 0, end: 0 }, "a robot file", problems);
    let groups = |name: &str| tree.table(name).map_or(&[][..], |table| table.entries.as_slice());
    let devices: Vec<(String, Option<DeviceFile>)> = groups("devices")
        .iter()
        .map(|entry| (entry.key.clone(), read_device(entry, plugins, problems)))
        .collect();
    let sensors: Vec<SensorDraft> =
        groups("sensors").iter().map(|entry| read_sensor(entry, &devices, problems)).collect();
    let drive = tree.entry("drive").and_then(|entry| read_drive(entry, &devices, problems));
    let axes = drive.as_ref().map_or(Axes::ALL, |drive| drive.axes);
    let robot = Robot {
        name: keys.name.unwrap_or_default(),
        radius_m: keys.footprint.unwrap_or_default().radius_m.unwrap_or_default(),
        limits: motion_limits(&keys.limits, axes),
        axes,
    };
    RobotDraft {
        path: path.to_owned(),
        robot,
        devices: devices.into_iter().filter_map(|(_, device)| device).collect(),
        sensors,
        drive,
    }
}

/// Checks `table` against the keys of `T` and reads those that are right.
pub(crate) fn read_keys<T>(table: &Table, header: Span, owner: &str, problems: &mut Vec<Problem>) -> T
where
    T: serde::de::DeserializeOwned + schemars::JsonSchema + Default,
{
    let schema = schemars::schema_for!(T).to_value();
    let before = problems.len();
    check_table(table, header, &[Shape::new(&schema)], owner, problems);
    right_keys(table, header, &problems[before..].to_vec(), problems)
}

/// Reads the keys of `T` that have none of the mistakes in `found`.
pub(crate) fn right_keys<T>(table: &Table, header: Span, found: &[Problem], problems: &mut Vec<Problem>) -> T
where
    T: serde::de::DeserializeOwned + Default,
{
    match prune(table, found).to_toml(|_| true).try_into() {
        Ok(keys) => keys,
        Err(error) => {
            if found.is_empty() {
                problems.push(Problem::new(header, error.message().to_owned()));
            }
            T::default()
        }
    }
}

fn prune(table: &Table, found: &[Problem]) -> Table {
    let wrong = |span: Span| found.iter().any(|problem| problem.span == span);
    let entries = table.entries.iter().filter(|entry| !wrong(entry.key_span) && !wrong(entry.node.span));
    let entries = entries.map(|entry| Entry { node: prune_node(&entry.node, found), ..entry.clone() });
    Table { entries: entries.collect() }
}

fn prune_node(node: &Node, found: &[Problem]) -> Node {
    let wrong = |item: &&Node| !found.iter().any(|problem| problem.span == item.span);
    let value = match &node.value {
        Value::Table(table) => Value::Table(prune(table, found)),
        Value::List(items) => {
            Value::List(items.iter().filter(wrong).map(|item| prune_node(item, found)).collect())
        }
        other => other.clone(),
    };
    Node { span: node.span, value }
}

/// The keys of a table that are not among those of the schema `common`, or are in `own` as well.
pub(crate) fn own_keys(table: &Table, common: &Json, own: &Json) -> toml::Table {
    let has = |schema: &Json, key: &str| Shape::new(schema).properties().iter().any(|(name, _)| *name == key);
    table.to_toml(|key| has(own, key) || !has(common, key))
}

/// A name must fit into messages and service names.
pub(crate) fn check_name(entry: &Entry, problems: &mut Vec<Problem>) {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if entry.key.is_empty() || entry.key.len() > 32 || !entry.key.chars().all(allowed) {
        problems.push(
            Problem::new(entry.key_span, format!("`{}` cannot be a name", entry.key))
                .label("1 to 32 letters, digits, `-` and `_`")
                .help("for example front-sonar"),
        );
    }
}

fn read_device(entry: &Entry, plugins: &Plugins<'_>, problems: &mut Vec<Problem>) -> Option<DeviceFile> {
    check_name(entry, problems);
    let table = entry.node.as_table()?;
    let owner = format!("device `{}`", entry.key);
    let common = schemars::schema_for!(DeviceKeys).to_value();
    let Some(driver) = table.entry("driver") else {
        let drivers = plugins.drivers.iter().map(|driver| driver.name);
        problems.push(
            Problem::new(entry.node.span, "`driver` is missing")
                .label(format!("{owner} needs it"))
                .help(instead("", drivers, "driver")),
        );
        return None;
    };
    let Some(name) = driver.node.as_text() else {
        check_table(table, entry.node.span, &[Shape::new(&common)], &owner, problems);
        return None;
    };
    let Some(plugin) = plugins.driver(name) else {
        let drivers = plugins.drivers.iter().map(|driver| driver.name);
        problems.push(
            Problem::new(driver.node.span, format!("there is no driver `{name}`"))
                .label("unknown")
                .help(instead(name, drivers, "driver")),
        );
        return None;
    };
    let own = (plugin.schema)().to_value();
    check_table(table, entry.node.span, &[Shape::new(&common), Shape::new(&own)], &owner, problems);
    Some(DeviceFile { name: entry.key.clone(), driver: *plugin, table: own_keys(table, &common, &own) })
}

/// The driver and the kind that a sensor or the drive names.
fn device_and_kind<'a>(
    entry: &Entry,
    devices: &'a [(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> Option<(&'a DriverPlugin, String, Option<String>)> {
    let table = entry.node.as_table()?;
    let device = table.entry("device")?;
    let name = device.node.as_text()?;
    let Some((_, file)) = devices.iter().find(|(known, _)| known == name) else {
        problems.push(
            Problem::new(device.node.span, format!("there is no device `{name}`"))
                .label("unknown")
                .help(instead(name, devices.iter().map(|(name, _)| name.as_str()), "device")),
        );
        return None;
    };
    let kind = table.entry("kind").and_then(|kind| kind.node.as_text());
    file.as_ref().map(|file| (&file.driver, name.to_owned(), kind.map(str::to_owned)))
}

fn unknown_kind(entry: &Entry, kind: &str, driver: &str, offered: &[&str], what: &str) -> Problem {
    let span = entry.node.as_table().and_then(|table| table.span_of("kind")).unwrap_or(entry.node.span);
    Problem::new(span, format!("driver `{driver}` has no {what} `{kind}`")).label("unknown").help(instead(
        kind,
        offered.iter().copied(),
        what,
    ))
}

/// Checks a sensor or the drive against the keys that all have and, where the kind is known, its own.
fn check_part(
    entry: &Entry,
    own: Option<&Json>,
    owner: &str,
    problems: &mut Vec<Problem>,
) -> Option<toml::Table> {
    let table = entry.node.as_table()?;
    let common = schemars::schema_for!(PartKeys).to_value();
    let before = problems.len();
    let Some(own) = own else {
        let mut found = Vec::new();
        check_table(table, entry.node.span, &[Shape::new(&common)], owner, &mut found);
        // Its own keys cannot be judged while the kind is not known.
        found.retain(|problem| !problem.message.starts_with("unknown key"));
        problems.append(&mut found);
        return None;
    };
    check_table(table, entry.node.span, &[Shape::new(&common), Shape::new(own)], owner, problems);
    (problems.len() == before).then(|| own_keys(table, &common, own))
}

fn read_sensor(
    entry: &Entry,
    devices: &[(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> SensorDraft {
    check_name(entry, problems);
    let mut draft =
        SensorDraft { name: entry.key.clone(), span: entry.node.span, plugin: None, info: None, file: None };
    let named = device_and_kind(entry, devices, problems);
    if let Some((driver, _, Some(kind))) = &named {
        draft.plugin = driver.sensor(kind);
        if draft.plugin.is_none() {
            let offered: Vec<&str> = driver.sensors.iter().map(|plugin| plugin.kind).collect();
            problems.push(unknown_kind(entry, kind, driver.name, &offered, "sensor"));
        }
    }
    let own = draft.plugin.map(|plugin| (plugin.schema)().to_value());
    let table = check_part(entry, own.as_ref(), &format!("sensor `{}`", entry.key), problems);
    let (Some(plugin), Some(table), Some((_, device, _))) = (draft.plugin, table, named) else {
        return draft;
    };
    match ((plugin.describe)(&entry.key, &table), (plugin.most_bytes)(&table)) {
        (Ok(info), Ok(most_bytes)) => {
            draft.info = Some(info.clone());
            let part = PartSpec { name: entry.key.clone(), kind: plugin.kind.to_owned(), table };
            draft.file = Some(SensorFile { device, part, info, most_bytes });
        }
        (Err(error), _) | (_, Err(error)) => problems.push(refusal(entry, &error)),
    }
    draft
}

fn read_drive(
    entry: &Entry,
    devices: &[(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> Option<DriveFile> {
    let named = device_and_kind(entry, devices, problems);
    let mut plugin = None;
    if let Some((driver, _, Some(kind))) = &named {
        plugin = driver.drive(kind);
        if plugin.is_none() {
            let offered: Vec<&str> = driver.drives.iter().map(|plugin| plugin.kind).collect();
            problems.push(unknown_kind(entry, kind, driver.name, &offered, "drive"));
        }
    }
    let own = plugin.map(|plugin| (plugin.schema)().to_value());
    let table = check_part(entry, own.as_ref(), "the drive", problems);
    let (plugin, (_, device, _)) = (plugin?, named?);
    // The axes count for the behaviours even where a key is wrong; the file is refused then anyway.
    let part =
        PartSpec { name: "drive".into(), kind: plugin.kind.to_owned(), table: table.unwrap_or_default() };
    Some(DriveFile { device, part, axes: plugin.axes })
}

fn motion_limits(keys: &LimitsKeys, axes: Axes) -> MotionLimits {
    let lateral = if axes.contains(Axis::Lateral) { keys.max_linear_mps } else { 0.0 };
    let triple =
        |linear: f64, lateral: Option<f64>, angular: f64| [linear, lateral.unwrap_or(linear), angular];
    MotionLimits {
        speed: [keys.max_linear_mps, keys.max_lateral_mps.unwrap_or(lateral), keys.max_angular_radps],
        acceleration: triple(
            keys.linear_acceleration_mps2,
            keys.lateral_acceleration_mps2,
            keys.angular_acceleration_radps2,
        ),
        deceleration: triple(
            keys.linear_deceleration_mps2,
            keys.lateral_deceleration_mps2,
            keys.angular_deceleration_radps2,
        ),
        emergency: triple(
            keys.linear_emergency_mps2,
            keys.lateral_emergency_mps2,
            keys.angular_emergency_radps2,
        ),
        jerk: triple(keys.linear_jerk_mps3, keys.lateral_jerk_mps3, keys.angular_jerk_radps3),
    }
}
