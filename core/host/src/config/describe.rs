//! What can be known of a plugin, or of the keys that every file has, for people.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value as Json;

use super::tables::{
    ArbiterKeys, BehaviorKeys, FootprintKeys, LimitsKeys, PartKeys, RunKeys, SensorKeys, WireKeys,
};
use yamabico_core::behavior::SlotInfo;
use yamabico_core::driver::SensorOffer;
use yamabico_core::plugins::Plugins;
use yamabico_parameters::{Shape, instead, number, unit_of};

/// Everything that can be composed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Listing {
    /// For task files.
    pub behaviors: Vec<Listed>,
    /// For robot files: drivers, and behind each `driver/kind` its sensors and drives.
    pub devices: Vec<Listed>,
}

/// A plugin in a [`Listing`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Listed {
    /// What [`describe`] takes.
    pub name: String,
    /// `behavior`, `driver`, `sensor` or `drive`.
    pub what: &'static str,
    /// In one sentence.
    pub summary: String,
}

/// What can be known of one plugin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Description {
    /// Its name.
    pub name: String,
    /// `behavior`, `driver`, `sensor`, `drive` or `table`.
    pub what: &'static str,
    /// In one sentence.
    pub summary: String,
    /// What it takes.
    pub inputs: Vec<Port>,
    /// What it gives besides proposals.
    pub outputs: Vec<Port>,
    /// The axes that it may claim, or has.
    pub axes: Option<String>,
    /// Its keys.
    pub parameters: Vec<Parameter>,
    /// The keys that all of its sort have.
    pub common: Vec<Parameter>,
}

/// An input or output.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Port {
    /// Its name.
    pub name: String,
    /// The message that passes.
    pub message: &'static str,
    /// Whether it must be plugged in.
    pub required: bool,
    /// What it is for.
    pub summary: String,
}

/// A key and what it takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// The key; dotted inside a table.
    pub key: String,
    /// `number`, `integer`, `string`, `boolean`, `array`, `table`, or the choices.
    pub takes: String,
    /// Unit, from the key's ending.
    pub unit: Option<&'static str>,
    /// Smallest and largest value, as `0.05 to 10`.
    pub range: Option<String>,
    /// What counts where the key is absent.
    pub default: Option<Json>,
    /// Whether it must be there.
    pub required: bool,
    /// What it is for.
    pub summary: String,
}

/// The names of all plugins.
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

/// Everything about one plugin: a behavior, a driver, `driver/kind`, or a table that every file has (`arbiter`, `run`,
/// `limits`, `footprint`, `inhibit`, `suppress`).
///
/// # Errors
/// No such name, with the nearest.
pub fn describe(name: &str, plugins: &Plugins) -> Result<Description, String> {
    if let Some(behavior) = plugins.behavior(name) {
        let plugin = behavior.info();
        return Ok(Description {
            inputs: ports(&plugin.inputs),
            outputs: ports(&plugin.outputs),
            axes: Some(plugin.claims.to_string()),
            common: parameters(&schemars::schema_for!(BehaviorKeys).to_value()),
            ..plain(name, "behavior", &plugin.summary, &plugin.parameters)
        });
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
                summary: plugin.summary.clone(),
            };
            let own = plain(name, "sensor", &plugin.summary, &plugin.parameters);
            let common = parameters(&schemars::schema_for!(SensorKeys).to_value());
            return Ok(Description { outputs: vec![gives], common, ..own });
        }
        if let Some(plugin) = driver.info().drive(kind) {
            let own = plain(name, "drive", &plugin.summary, &plugin.parameters);
            let common = parameters(&schemars::schema_for!(PartKeys).to_value());
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
    Err(format!("there is nothing called `{name}`; {help}"))
}

fn tables() -> [(&'static str, &'static str, Json); 6] {
    [
        ("run", "When a run ends.", schemars::schema_for!(RunKeys).to_value()),
        ("arbiter", "How proposals become a command.", schemars::schema_for!(ArbiterKeys).to_value()),
        ("inhibit", "While one is active, another is not heard.", schemars::schema_for!(WireKeys).to_value()),
        ("suppress", "Likewise, on the claimed axes only.", schemars::schema_for!(WireKeys).to_value()),
        ("footprint", "The room that the robot takes.", schemars::schema_for!(FootprintKeys).to_value()),
        ("limits", "What the drive can do.", schemars::schema_for!(LimitsKeys).to_value()),
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
        parameters: parameters(schema),
        common: Vec::new(),
    }
}

fn ports(slots: &[SlotInfo]) -> Vec<Port> {
    let port = |slot: &SlotInfo| Port {
        name: slot.name.to_string(),
        message: slot.message.name,
        required: slot.required,
        summary: slot.summary.to_string(),
    };
    slots.iter().map(port).collect()
}

fn parameters(schema: &Json) -> Vec<Parameter> {
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
    // The bounds of the machine's integers say nothing about the parameter.
    let useful = |bound: f64| bound.abs() < 2e9;
    let low = shape.bound("minimum").or(shape.bound("exclusiveMinimum")).filter(|bound| useful(*bound));
    let high = shape.bound("maximum").or(shape.bound("exclusiveMaximum")).filter(|bound| useful(*bound));
    match (low, high) {
        (Some(low), Some(high)) => Some(format!("{} to {}", number(low), number(high))),
        (Some(low), None) => Some(format!("from {}", number(low))),
        (None, Some(high)) => Some(format!("up to {}", number(high))),
        (None, None) => None,
    }
}

/// Every kind of sensor with the drivers that offer it.
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
