//! Reading of a robot file.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value as Json;

use super::exec::{ask_driver, program_of};
use super::keys::{check_name, own_keys, read_keys};
use super::limits::{check_braking, check_wheels, motion_limits};
use super::paths::{Home, resolve_paths};
use super::robot::{DeviceFile, DriveFile, RobotFile, SensorFile};
use super::source_map::refusal;
use super::tables::{Clock, DeviceKeys, Isolation, PartKeys, RobotKeys, SensorKeys, WheelKeys};
use crate::settings::milliseconds;
use crate::{Deadline, HostSettings};
use yamabico_core::drive::Wheels;
use yamabico_core::driver::{Driver, PartSpec, SensorDescription};
use yamabico_core::message::{Axes, MessageType};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{Robot, SensorInfo};
use yamabico_parameters::{Entry, Problem, Shape, Span, Table, Value, check_table, instead, quoted};

/// Valid parts of a robot file. Behaviors are checked against it even if a part is invalid.
pub(crate) struct RobotDraft {
    pub path: PathBuf,
    pub parts: Vec<PathBuf>,
    pub robot: Robot,
    pub clock: Clock,
    pub devices: Vec<DeviceFile>,
    pub sensors: Vec<SensorDraft>,
    pub drive: Option<DriveFile>,
}

/// Valid parts of a sensor.
pub(crate) struct SensorDraft {
    pub name: String,
    pub span: Span,
    pub message: Option<MessageType>,
    pub info: Option<SensorInfo>,
    pub file: Option<SensorFile>,
}

impl RobotDraft {
    /// Returns the checked file, or `None` if a part is invalid.
    pub fn finish(self) -> Option<RobotFile> {
        let sensors: Option<Vec<SensorFile>> = self.sensors.into_iter().map(|sensor| sensor.file).collect();
        Some(RobotFile {
            path: self.path,
            parts: self.parts,
            robot: self.robot,
            clock: self.clock,
            devices: self.devices,
            sensors: sensors?,
            drive: self.drive?,
        })
    }
}

/// Reads the tree of the file `home`.
pub(crate) fn read_robot(
    home: Home<'_>,
    tree: &Table,
    plugins: &Plugins,
    problems: &mut Vec<Problem>,
) -> RobotDraft {
    let keys: RobotKeys =
        read_keys(tree, Span { source: home.source, start: 0, end: 0 }, "a robot file", problems);
    let groups = |name: &str| tree.table(name).map_or(&[][..], |table| table.entries.as_slice());
    let devices: Vec<(String, Option<DeviceFile>)> = groups("devices")
        .iter()
        .map(|entry| (entry.key.clone(), read_device(entry, home, plugins, problems)))
        .collect();
    let sensors: Vec<SensorDraft> =
        groups("sensors").iter().map(|entry| read_sensor(entry, home, &devices, problems)).collect();
    let drive = tree.entry("drive").and_then(|entry| read_drive(entry, home, &devices, problems));
    let axes = drive.as_ref().map_or(Axes::ALL, |drive| drive.axes);
    if let Some((name, entry)) = keys.name.as_deref().zip(tree.entry("name")) {
        check_name(name, entry.node.span, problems);
    }
    check_braking(&keys.limits, tree, problems);
    if let Some(drive) = &drive {
        check_wheels(drive, &motion_limits(&keys.limits, axes), tree, problems);
    }
    let robot = Robot {
        name: keys.name.unwrap_or_default(),
        radius_m: keys.footprint.unwrap_or_default().radius_m.unwrap_or_default(),
        limits: motion_limits(&keys.limits, axes),
        axes,
    };
    let owns_a_clock = matches!(devices.as_slice(), [(_, device)] if device.as_ref().is_none_or(|device| !device.settings.exec.is_empty()));
    if let Some(entry) = tree.entry("clock").filter(|_| keys.clock == Clock::Driver && !owns_a_clock) {
        problems.push(
            Problem::new(entry.node.span, "no driver provides the clock")
                .label("requires exactly one device, with an external program")
                .help("name the program with exec = [...], or remove `clock`"),
        );
    }
    RobotDraft {
        path: home.path.to_owned(),
        parts: Vec::new(),
        robot,
        clock: keys.clock,
        devices: devices.into_iter().filter_map(|(_, device)| device).collect(),
        sensors,
        drive,
    }
}

fn read_device(
    entry: &Entry,
    home: Home<'_>,
    plugins: &Plugins,
    problems: &mut Vec<Problem>,
) -> Option<DeviceFile> {
    check_name(&entry.key, entry.key_span, problems);
    let table = entry.node.as_table()?;
    let owner = format!("device `{}`", entry.key);
    let common = schemars::schema_for!(DeviceKeys).to_value();
    let exec = program_of(table, home);
    if !exec.is_empty() {
        let plugin = ask_driver(&exec, entry, problems)?;
        return Some(device_file(entry, table, plugin, exec, home, problems));
    }
    let Some(driver) = table.entry("driver") else {
        let drivers: Vec<&str> = plugins.drivers.iter().map(|driver| &*driver.info().name).collect();
        problems.push(
            Problem::new(entry.node.span, "`driver` is missing")
                .label(format!("required by {owner}"))
                .help(format!("add driver = one of {}", quoted(&drivers))),
        );
        return None;
    };
    let Some(name) = driver.node.as_text() else {
        check_table(table, entry.node.span, &[Shape::new(&common)], &owner, problems);
        return None;
    };
    let Some(plugin) = plugins.driver(name) else {
        let drivers = plugins.drivers.iter().map(|driver| &*driver.info().name);
        problems.push(
            Problem::new(driver.node.span, format!("unknown driver `{name}`"))
                .label("unknown")
                .help(instead(name, drivers, "driver")),
        );
        return None;
    };
    Some(device_file(entry, table, Arc::clone(plugin), exec, home, problems))
}

/// Reads a device with a known driver.
fn device_file(
    entry: &Entry,
    table: &Table,
    driver: Arc<dyn Driver>,
    exec: Vec<String>,
    home: Home<'_>,
    problems: &mut Vec<Problem>,
) -> DeviceFile {
    let (common, own) = (schemars::schema_for!(DeviceKeys).to_value(), driver.info().parameters.clone());
    let owner = format!("device `{}`", entry.key);
    check_table(table, entry.node.span, &[Shape::new(&common), Shape::new(&own)], &owner, problems);
    let mut keys = own_keys(table, &common, &own);
    resolve_paths(table, &own, home, &mut keys, problems);
    let right = |key: &str| matches!(key, "isolation" | "deadline_ms" | "scheduling");
    let common: DeviceKeys = table.to_toml(right).try_into().unwrap_or_default();
    DeviceFile {
        name: entry.key.clone(),
        driver,
        table: keys,
        settings: HostSettings {
            isolation: if exec.is_empty() { common.isolation } else { Isolation::Process },
            deadline: Deadline::new(milliseconds(common.deadline_ms)),
            scheduling: common.scheduling.scheduling(),
            exec,
        },
    }
}

/// Returns the driver, the device and the kind that a sensor or the drive names.
fn device_and_kind<'a>(
    entry: &Entry,
    devices: &'a [(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> Option<(&'a dyn Driver, String, Option<String>)> {
    let table = entry.node.as_table()?;
    let device = table.entry("device")?;
    let name = device.node.as_text()?;
    let Some((_, file)) = devices.iter().find(|(known, _)| known == name) else {
        problems.push(
            Problem::new(device.node.span, format!("this robot has no device `{name}`"))
                .label("unknown")
                .help(instead(name, devices.iter().map(|(name, _)| name.as_str()), "device")),
        );
        return None;
    };
    let kind = table.entry("kind").and_then(|kind| kind.node.as_text());
    file.as_ref().map(|file| (file.driver.as_ref(), name.to_owned(), kind.map(str::to_owned)))
}

fn unknown_kind(entry: &Entry, kind: &str, driver: &str, offered: &[&str], what: &str) -> Problem {
    let span = entry.node.as_table().and_then(|table| table.span_of("kind")).unwrap_or(entry.node.span);
    Problem::new(span, format!("driver `{driver}` has no {what} `{kind}`")).label("unknown").help(instead(
        kind,
        offered.iter().copied(),
        what,
    ))
}

/// Schemas of a sensor or the drive.
struct PartShape<'a> {
    owner: String,
    /// Schema of the common keys.
    common: Json,
    /// Schema of its parameters, if its kind is known.
    own: Option<&'a Json>,
    /// Kinds that its driver offers, if its device is known.
    offered: &'a [&'a str],
}

/// Checks a sensor or the drive against the common keys and, if the kind is known, its parameters.
fn check_part(
    entry: &Entry,
    shape: &PartShape<'_>,
    home: Home<'_>,
    problems: &mut Vec<Problem>,
) -> Option<toml::Table> {
    let table = entry.node.as_table()?;
    let mut shapes = vec![Shape::new(&shape.common)];
    shapes.extend(shape.own.map(Shape::new));
    let mut found = Vec::new();
    check_table(table, entry.node.span, &shapes, &shape.owner, &mut found);
    if shape.own.is_none() {
        // Without the kind, only misspelled common keys can be reported.
        let required = Shape::new(&shape.common).required();
        let meant: Vec<String> = required.iter().map(|key| format!("did you mean `{key}`?")).collect();
        found.retain(|problem| {
            !problem.message.starts_with("unknown key")
                || problem.help.as_ref().is_some_and(|help| meant.contains(help))
        });
    }
    for problem in found.iter_mut().filter(|problem| problem.message == "`kind` is missing") {
        if !shape.offered.is_empty() {
            problem.help = Some(format!("add kind = one of {}", quoted(shape.offered)));
        }
    }
    let mut keys = shape.own.map(|own| own_keys(table, &shape.common, own));
    if let (Some(own), Some(keys)) = (shape.own, &mut keys) {
        resolve_paths(table, own, home, keys, &mut found);
    }
    let is_right = found.is_empty();
    problems.append(&mut found);
    keys.filter(|_| is_right)
}

fn read_sensor(
    entry: &Entry,
    home: Home<'_>,
    devices: &[(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> SensorDraft {
    check_name(&entry.key, entry.key_span, problems);
    let mut draft =
        SensorDraft { name: entry.key.clone(), span: entry.node.span, message: None, info: None, file: None };
    let named = device_and_kind(entry, devices, problems);
    let sensors = named.as_ref().map_or(&[][..], |(driver, ..)| driver.info().sensors.as_slice());
    let offered: Vec<&str> = sensors.iter().map(|offer| &*offer.kind).collect();
    let mut offer = None;
    if let Some((driver, _, Some(kind))) = &named {
        offer = driver.info().sensor(kind);
        if offer.is_none() {
            problems.push(unknown_kind(entry, kind, &driver.info().name, &offered, "sensor"));
        }
    }
    draft.message = offer.map(|offer| offer.message);
    let shape = PartShape {
        owner: format!("sensor `{}`", entry.key),
        common: schemars::schema_for!(SensorKeys).to_value(),
        own: offer.map(|offer| &offer.parameters),
        offered: &offered,
    };
    let table = check_part(entry, &shape, home, problems);
    let (Some(offer), Some(table), Some((driver, device, _))) = (offer, table, &named) else {
        return draft;
    };
    let part = PartSpec { name: entry.key.clone(), kind: offer.kind.clone(), table };
    match driver.describe_sensor(&part, home.folder()) {
        Ok(SensorDescription { info, max_item_bytes }) => {
            draft.info = Some(info.clone());
            if let Err(error) = driver.check_sensor(&part, home.folder()) {
                let other = format!("--set robot.sensors.{}.{}=...", entry.key, error.key);
                problems.push(refusal(entry, &error).help(format!("to change it for one run: {other}")));
            }
            let (critical, max_age) = criticality(entry, &info, problems);
            let device = device.clone();
            draft.file = Some(SensorFile { device, part, info, max_item_bytes, critical, max_age });
        }
        Err(error) => problems.push(refusal(entry, &error)),
    }
    draft
}

/// Returns whether the robot stops without the sensor, and the age above which the sensor counts as dead.
fn criticality(entry: &Entry, info: &SensorInfo, problems: &mut Vec<Problem>) -> (bool, Duration) {
    let table = entry.node.as_table();
    let value = |key: &str| table.and_then(|table| table.entry(key)).map(|entry| &entry.node);
    let critical = value("critical").is_some_and(|node| matches!(node.value, Value::Switch(true)));
    let written = value("max_age_ms").and_then(|node| match node.value {
        Value::Whole(number) => Some((number as f64 * 1e-3, node.span)),
        Value::Number(number) => Some((number * 1e-3, node.span)),
        _ => None,
    });
    let min_s = info.period_s + info.latency_s;
    if let Some((_, span)) = written.filter(|(age, _)| *age < min_s) {
        let min_ms = yamabico_parameters::number(min_s * 1e3);
        problems.push(
            Problem::new(
                span,
                format!("`max_age_ms` of `{}` is shorter than the time between two measurements", entry.key),
            )
            .label(format!("its period plus latency is {min_ms} ms"))
            .help(format!(
                "raise it above {min_ms} ms, or remove it: the default is three periods plus the latency"
            )),
        );
    }
    let age = written.map_or(3.0 * info.period_s + info.latency_s, |(age, _)| age);
    (critical, Duration::try_from_secs_f64(age).unwrap_or(Duration::MAX))
}

fn read_drive(
    entry: &Entry,
    home: Home<'_>,
    devices: &[(String, Option<DeviceFile>)],
    problems: &mut Vec<Problem>,
) -> Option<DriveFile> {
    let named = device_and_kind(entry, devices, problems);
    let drives = named.as_ref().map_or(&[][..], |(driver, ..)| driver.info().drives.as_slice());
    let offered: Vec<&str> = drives.iter().map(|offer| &*offer.kind).collect();
    let mut offer = None;
    if let Some((driver, _, Some(kind))) = &named {
        offer = driver.info().drive(kind);
        if offer.is_none() {
            problems.push(unknown_kind(entry, kind, &driver.info().name, &offered, "drive"));
        }
    }
    let shape = PartShape {
        owner: "the drive".to_owned(),
        common: schemars::schema_for!(PartKeys).to_value(),
        own: offer.map(|offer| &offer.parameters),
        offered: &offered,
    };
    let table = check_part(entry, &shape, home, problems);
    let (offer, (_, device, _)) = (offer?, named.as_ref()?);
    // Behaviors are checked against the axes even if a key is invalid.
    let wheels = table.as_ref().and_then(|_| wheels(entry));
    let part = PartSpec { name: "drive".into(), kind: offer.kind.clone(), table: table.unwrap_or_default() };
    Some(DriveFile { device: device.clone(), part, axes: offer.axes, wheels })
}

/// Reads the wheels of a drive with valid keys.
fn wheels(entry: &Entry) -> Option<Wheels> {
    let keys: PartKeys = entry.node.as_table()?.to_toml(|key| key == "wheels").try_into().ok()?;
    let WheelKeys { count, from_center_m, radius_m, max_radps } = keys.wheels?;
    Some(Wheels { count, from_center_m, radius_m, max_radps })
}
