//! Descriptions of plugins and of the keys common to all files.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use serde_json::Value as Json;

use super::exec::{ask_behavior, read_tree};
use super::tables::{
    ArbiterKeys, BehaviorKeys, FootprintKeys, LimitsKeys, PartKeys, RunKeys, SensorKeys, WireKeys,
};
use yamabico_core::behavior::{BehaviorInfo, SlotInfo};
use yamabico_core::driver::{DriveOffer, SensorOffer};
use yamabico_core::message::Axes;
use yamabico_core::plugins::Plugins;
use yamabico_parameters::{Shape, instead, number, unit_of};

/// All plugins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Listing {
    /// Behaviors, for task files.
    pub behaviors: Vec<Listed>,
    /// Drivers, each followed by its sensors and drives as `driver/kind`, for robot files.
    pub devices: Vec<Listed>,
}

/// Plugin in a [`Listing`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Listed {
    /// Name for [`describe`].
    pub name: String,
    /// `behavior`, `driver`, `sensor` or `drive`.
    pub what: &'static str,
    /// Summary, one sentence.
    pub summary: String,
}

/// Description of a plugin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Description {
    /// Name.
    pub name: String,
    /// `behavior`, `driver`, `sensor`, `drive` or `table`.
    pub what: &'static str,
    /// Summary, one sentence.
    pub summary: String,
    /// Input slots.
    pub inputs: Vec<Port>,
    /// Outputs besides proposals.
    pub outputs: Vec<Port>,
    /// Axes that a behavior may drive, or that a drive has.
    pub axes: Option<String>,
    /// Parameters.
    pub parameters: Vec<Parameter>,
    /// Keys common to all plugins of this type.
    pub common: Vec<Parameter>,
}

/// Input or output.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Port {
    /// Name.
    pub name: String,
    /// Versioned name of the message type.
    pub message: &'static str,
    /// True if it must be connected.
    pub required: bool,
    /// True if it is optional, and connected to the only source that fits.
    pub preferred: bool,
    /// Purpose.
    pub summary: String,
}

/// Key and its values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Key; dotted inside a table.
    pub key: String,
    /// `number`, `integer`, `string`, `boolean`, `array`, `table`, or the allowed strings.
    pub takes: String,
    /// Unit, from the key's ending.
    pub unit: Option<&'static str>,
    /// Minimum and maximum, such as `0.05 to 10`; `each` for the numbers of an array.
    pub range: Option<String>,
    /// Value of an absent key.
    pub default: Option<Json>,
    /// True if the key is required.
    pub required: bool,
    /// Purpose.
    pub summary: String,
}

/// Lists all plugins.
pub fn list(plugins: &Plugins) -> Listing {
    let listed = |name: String, what, summary: &str| Listed { name, what, summary: summary.to_owned() };
    let behaviors = plugins.behaviors.iter().map(|behavior| behavior.info());
    let behaviors = behaviors.map(|info| listed(info.name.clone(), "behavior", &info.summary)).collect();
    let mut devices = Vec::new();
    for driver in &plugins.drivers {
        let driver = driver.info();
        let inside = |kind: &str| format!("{}/{kind}", driver.name);
        devices.push(listed(driver.name.clone(), "driver", &driver.summary));
        devices.extend(driver.sensors.iter().map(|part| listed(inside(&part.kind), "sensor", &part.summary)));
        devices.extend(driver.drives.iter().map(|part| listed(inside(&part.kind), "drive", &part.summary)));
    }
    Listing { behaviors, devices }
}

/// Describes a behavior, a driver, a sensor or drive as `driver/kind`, or a table common to all files (`arbiter`, `run`,
/// `limits`, `footprint`, `inhibit`, `suppress`).
///
/// # Errors
/// The name is unknown; the message suggests a similar one.
pub fn describe(name: &str, plugins: &Plugins) -> Result<Description, String> {
    if let Some(behavior) = plugins.behavior(name) {
        return Ok(describe_behavior(name, behavior.info()));
    }
    if let Some(driver) = plugins.driver(name) {
        return Ok(plain(name, "driver", &driver.info().summary, &driver.info().parameters));
    }
    if let Some((driver, kind)) = name.split_once('/')
        && let Some(driver) = plugins.driver(driver)
    {
        if let Some(plugin) = driver.info().sensor(kind) {
            let gives = Port {
                name: kind.to_owned(),
                message: plugin.message.name,
                required: false,
                preferred: false,
                summary: plugin.summary.clone(),
            };
            let own = plain(name, "sensor", &plugin.summary, &plugin.parameters);
            let common = describe_parameters(&schemars::schema_for!(SensorKeys).to_value());
            return Ok(Description { outputs: vec![gives], common, ..own });
        }
        if let Some(plugin) = driver.info().drive(kind) {
            let own = plain(name, "drive", &plugin.summary, &plugin.parameters);
            let common = describe_parameters(&schemars::schema_for!(PartKeys).to_value());
            return Ok(Description { axes: Some(plugin.axes.to_string()), common, ..own });
        }
    }
    let tables = tables();
    if let Some((_, summary, schema)) = tables.iter().find(|(known, ..)| *known == name) {
        return Ok(plain(name, "table", summary, schema));
    }
    let listing = list(plugins);
    let names = listing.behaviors.iter().chain(&listing.devices).map(|listed| listed.name.as_str());
    let help = instead(name, names.chain(tables.iter().map(|(name, ..)| *name)), "name");
    Err(format!("unknown name `{name}`; {help}"))
}

/// Describes the behavior `name` of the task file `path`, which may be an external program.
///
/// # Errors
/// The file cannot be read, has no such behavior, or the program of the behavior does not describe itself.
pub fn describe_in_task(name: &str, path: &Path, plugins: &Plugins) -> Result<Description, String> {
    let file = path.display();
    let tree = read_tree(path)?;
    let behaviors =
        tree.table("behaviors").ok_or_else(|| format!("{file} has no table [behaviors.{name}]"))?;
    let entry = behaviors.entry(name).ok_or_else(|| {
        let names = behaviors.entries.iter().map(|entry| entry.key.as_str());
        format!("{file} has no behavior `{name}`; {}", instead(name, names, "behavior"))
    })?;
    match ask_behavior(entry, path) {
        Some(factory) => Ok(describe_behavior(name, factory?.info())),
        None => {
            let kind = entry.node.as_table().and_then(|table| table.entry("type"));
            describe(kind.and_then(|kind| kind.node.as_text()).unwrap_or(name), plugins)
        }
    }
}

fn describe_behavior(name: &str, info: &BehaviorInfo) -> Description {
    Description {
        inputs: ports(&info.inputs),
        outputs: ports(&info.outputs),
        axes: Some(match info.claims {
            Axes::NONE => "none; it only halts or limits the motion of others".to_owned(),
            claims => claims.to_string(),
        }),
        common: describe_parameters(&schemars::schema_for!(BehaviorKeys).to_value()),
        ..plain(name, "behavior", &info.summary, &info.parameters)
    }
}

fn tables() -> [(&'static str, &'static str, Json); 6] {
    [
        ("run", "End of the run.", schemars::schema_for!(RunKeys).to_value()),
        ("arbiter", "Arbitration.", schemars::schema_for!(ArbiterKeys).to_value()),
        (
            "inhibit",
            "While one behavior is active, drive proposals of another are ignored.",
            schemars::schema_for!(WireKeys).to_value(),
        ),
        (
            "suppress",
            "Like `inhibit`, but only on the axes that the active behavior claims.",
            schemars::schema_for!(WireKeys).to_value(),
        ),
        ("footprint", "Footprint of the robot.", schemars::schema_for!(FootprintKeys).to_value()),
        ("limits", "Limits of the drive.", schemars::schema_for!(LimitsKeys).to_value()),
    ]
}

fn plain(name: &str, what: &'static str, summary: &str, schema: &Json) -> Description {
    Description {
        name: name.to_owned(),
        what,
        summary: summary.to_owned(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        axes: None,
        parameters: describe_parameters(schema),
        common: Vec::new(),
    }
}

fn ports(slots: &[SlotInfo]) -> Vec<Port> {
    let port = |slot: &SlotInfo| Port {
        name: slot.name.to_string(),
        message: slot.message.name,
        required: slot.required,
        preferred: slot.preferred,
        summary: slot.summary.to_string(),
    };
    slots.iter().map(port).collect()
}

/// Returns the keys of the plugin's parameters, `schema`.
pub fn describe_parameters(schema: &Json) -> Vec<Parameter> {
    let mut found = Vec::new();
    collect("", Shape::new(schema), 0, &mut found);
    found
}

fn collect(prefix: &str, shape: Shape<'_>, depth: usize, found: &mut Vec<Parameter>) {
    let shape = shape.resolved();
    let required = shape.required();
    for (key, part) in shape.properties() {
        let inner = part.resolved();
        let text = |name: &str| part.text(name).or(inner.text(name));
        let key_path = format!("{prefix}{key}");
        let default = part.part.get("default").or(inner.part.get("default")).filter(|value| !value.is_null());
        let is_table = !inner.properties().is_empty();
        found.push(Parameter {
            unit: unit_of(key),
            takes: takes(inner),
            range: range(inner).or_else(|| range(part)),
            default: default.filter(|_| !is_table).cloned(),
            required: required.contains(key),
            summary: text("description").unwrap_or("").replace('\n', " "),
            key: key_path.clone(),
        });
        if is_table && depth < 4 {
            collect(&format!("{key_path}."), inner, depth + 1, found);
        }
        for branch in inner.alternatives().into_iter().filter(|_| depth < 4) {
            collect(&format!("{key_path}."), branch, depth + 1, found);
        }
    }
}

fn takes(shape: Shape<'_>) -> String {
    let words = shape.words();
    if !words.is_empty() {
        let words: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
        return words.join(" | ");
    }
    match shape.types().as_slice() {
        [] if !shape.alternatives().is_empty() => "table".to_owned(),
        [] => "anything".to_owned(),
        types => types.join(" or ").replace("object", "table"),
    }
}

fn range(shape: Shape<'_>) -> Option<String> {
    // The bounds of an integer type are not bounds of the parameter.
    let useful = |bound: f64| bound.abs() < 2e9;
    let low = shape.bound("minimum").or(shape.bound("exclusiveMinimum")).filter(|bound| useful(*bound));
    let high = shape.bound("maximum").or(shape.bound("exclusiveMaximum")).filter(|bound| useful(*bound));
    if (low, high) == (None, None)
        && let Some(items) = shape.part.get("items").filter(|items| items.is_object())
    {
        let range = range(shape.at(items))?;
        return Some(if range.starts_with("each") { range } else { format!("each {range}") });
    }
    match (low, high) {
        (Some(low), Some(high)) => Some(format!("{} to {}", number(low), number(high))),
        (Some(low), None) => Some(format!("from {}", number(low))),
        (None, Some(high)) => Some(format!("up to {}", number(high))),
        (None, None) => None,
    }
}

/// Returns every kind of sensor with the drivers that offer it.
pub(crate) fn kinds_of_sensors(plugins: &Plugins) -> BTreeMap<&str, Vec<(&str, &SensorOffer)>> {
    let mut kinds = BTreeMap::<_, Vec<_>>::new();
    for driver in &plugins.drivers {
        let info = driver.info();
        for offer in &info.sensors {
            kinds.entry(&*offer.kind).or_default().push((&*info.name, offer));
        }
    }
    kinds
}

/// Returns every kind of drive with the drivers that offer it.
pub(crate) fn kinds_of_drives(plugins: &Plugins) -> BTreeMap<&str, Vec<(&str, &DriveOffer)>> {
    let mut kinds = BTreeMap::<_, Vec<_>>::new();
    for driver in &plugins.drivers {
        let info = driver.info();
        for offer in &info.drives {
            kinds.entry(&*offer.kind).or_default().push((&*info.name, offer));
        }
    }
    kinds
}
