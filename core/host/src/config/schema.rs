//! JSON Schemas of configuration files, for editors.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value as Json, json};

use super::exec::{ask_behavior, read_tree};
use super::tables::{BehaviorKeys, DeviceKeys, PartKeys, RobotKeys, SensorKeys, TaskKeys};
use yamabico_core::behavior::{BehaviorFactory, BehaviorInfo, SlotInfo};
use yamabico_core::plugins::Plugins;

const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

/// Returns the JSON Schema of every kind of file: `{ "task": ..., "robot": ..., "world": ... }`. Kinds of files named by
/// parameters have the name of the parameter.
pub fn schema(plugins: &Plugins) -> Json {
    let robot = robot_schema(plugins);
    let part = robot_part(robot.clone());
    let mut kinds = json!({ "task": task_schema(plugins), "robot": robot, "robot_part": part });
    let of_drivers = plugins.drivers.iter().flat_map(|driver| &driver.info().files);
    for file in of_drivers.chain(plugins.behaviors.iter().flat_map(|behavior| &behavior.info().files)) {
        kinds[file.key] = (file.schema)().to_value();
    }
    kinds
}

/// Returns the same schemas, with the keys of the external programs that are behaviors of the task file `path`.
///
/// # Errors
/// The file cannot be read, or a program does not describe itself.
pub fn schema_with_task(path: &Path, plugins: &Plugins) -> Result<Json, String> {
    let tree = read_tree(path)?;
    let entries = tree.table("behaviors").map_or(&[][..], |behaviors| behaviors.entries.as_slice());
    let asked = entries.iter().filter_map(|entry| Some((entry.key.clone(), ask_behavior(entry, path)?)));
    let programs = asked.map(|(name, factory)| Ok((name, factory?))).collect::<Result<Vec<_>, String>>()?;
    let mut kinds = schema(plugins);
    kinds["task"] = schema_of_tasks(plugins, &programs);
    Ok(kinds)
}

/// Returns the JSON Schema of a task file.
pub fn task_schema(plugins: &Plugins) -> Json {
    schema_of_tasks(plugins, &[])
}

/// Returns the JSON Schema of a task file; `programs` are behaviors by name that are external programs.
fn schema_of_tasks(plugins: &Plugins, programs: &[(String, Arc<dyn BehaviorFactory>)]) -> Json {
    let mut whole = Whole::new(schemars::schema_for!(TaskKeys).to_value(), "A task of Yamabico");
    let common = whole.include("behavior", schemars::schema_for!(BehaviorKeys).to_value());
    let mut choices = vec![common.clone(), free_with_exec()];
    let mut unnamed = Vec::new();
    for behavior in &plugins.behaviors {
        let plugin = behavior.info();
        let own = whole.include(&format!("behavior.{}", plugin.name), own_keys(plugin));
        choices.push(when("type", &plugin.name, own.clone()));
        let is_unnamed = json!({ "not": { "anyOf": [{ "required": ["type"] }, { "required": ["exec"] }] } });
        unnamed.push((plugin.name.clone(), json!({ "if": is_unnamed, "then": own })));
    }
    let every = whole.define("behavior.any", json!({ "type": "object", "allOf": choices }));
    let mut named: Map<String, Json> =
        unnamed.into_iter().map(|(name, own)| (name, closed(vec![every.clone(), own]))).collect();
    for (name, program) in programs {
        let own = whole.include(&format!("program.{name}"), own_keys(program.info()));
        named.insert(name.clone(), closed(vec![common.clone(), own]));
    }
    let any = closed(vec![every]);
    whole.set("behaviors", json!({ "type": "object", "properties": named, "additionalProperties": any }));
    whole.json
}

/// Returns the JSON Schema of a robot file.
pub fn robot_schema(plugins: &Plugins) -> Json {
    let mut whole = Whole::new(schemars::schema_for!(RobotKeys).to_value(), "A robot of Yamabico");
    let mut devices = vec![whole.include("device", schemars::schema_for!(DeviceKeys).to_value())];
    devices.push(free_with_exec());
    let mut sensors = vec![whole.include("sensor", schemars::schema_for!(SensorKeys).to_value())];
    let mut drives = vec![whole.include("drive", schemars::schema_for!(PartKeys).to_value())];
    for driver in plugins.drivers.iter().map(|driver| driver.info()) {
        let mut own = driver.parameters.clone();
        describe_as(&mut own, &driver.summary);
        let own = whole.include(&format!("device.{}", driver.name), own);
        devices.push(when("driver", &driver.name, own));
    }
    for (kind, parts) in super::describe::kinds_of_sensors(plugins) {
        let any: Vec<Json> = parts
            .into_iter()
            .map(|(driver, plugin)| {
                let mut own = plugin.parameters.clone();
                describe_as(&mut own, &plugin.summary);
                whole.include(&format!("sensor.{driver}.{kind}"), own)
            })
            .collect();
        sensors.push(when("kind", kind, json!({ "anyOf": any })));
    }
    for driver in plugins.drivers.iter().map(|driver| driver.info()) {
        for plugin in &driver.drives {
            let mut own = plugin.parameters.clone();
            describe_as(&mut own, &plugin.summary);
            let own = whole.include(&format!("drive.{}.{}", driver.name, plugin.kind), own);
            drives.push(when("kind", &plugin.kind, own));
        }
    }
    whole.set("devices", json!({ "type": "object", "additionalProperties": closed(devices) }));
    let sensors = whole.define("sensor.any", closed(sensors));
    let drive = whole.define("drive.any", closed(drives));
    whole.set("sensors", json!({ "type": "object" }));
    whole.set("drive", json!({ "type": "object" }));
    // A robot file may get any table from the files that it includes.
    if let Some(required) = whole.json.as_object_mut().and_then(|object| object.remove("required")) {
        let alone = json!({ "not": { "required": ["include"] } });
        whole.json["allOf"] = json!([{ "if": alone, "then": { "required": required } }]);
    }
    // Sensors and the drive of an external program may have unknown keys.
    whole.json["if"] = json!({ "properties": { "devices": { "additionalProperties": { "not": { "required": ["exec"] } } } } });
    whole.json["then"] = json!({
        "properties": { "sensors": { "additionalProperties": sensors }, "drive": drive }
    });
    whole.json
}

/// Returns the JSON Schema of a file that robot files include.
fn robot_part(mut robot: Json) -> Json {
    robot["title"] = "A part of robots of Yamabico".into();
    if let Some(object) = robot.as_object_mut() {
        object.remove("allOf");
    }
    if let Some(properties) = robot["properties"].as_object_mut() {
        properties.remove("include");
    }
    robot
}

/// Allows any key if `exec` names a program, which defines its own keys.
fn free_with_exec() -> Json {
    json!({ "if": { "required": ["exec"] }, "then": { "additionalProperties": true } })
}

/// Table with the keys of all `parts` and no others.
fn closed(parts: Vec<Json>) -> Json {
    json!({ "type": "object", "allOf": parts, "unevaluatedProperties": false })
}

/// Applies `then` if `key` is `word`.
fn when(key: &str, word: &str, then: Json) -> Json {
    json!({ "if": { "properties": { key: { "const": word } }, "required": [key] }, "then": then })
}

fn describe_as(schema: &mut Json, summary: &str) {
    if let Some(object) = schema.as_object_mut() {
        object.insert("description".into(), summary.into());
    }
}

/// Returns the schema of the keys of a behavior, with its slots as keys of `inputs`.
fn own_keys(behavior: &BehaviorInfo) -> Json {
    let mut own = behavior.parameters.clone();
    describe_as(&mut own, &behavior.summary);
    set_inputs(&mut own, &behavior.inputs);
    own
}

/// Adds the slots as keys of `inputs`.
fn set_inputs(schema: &mut Json, slots: &[SlotInfo]) {
    let properties: Map<String, Json> = slots
        .iter()
        .map(|slot| {
            let about = format!("{} Takes {}.", slot.summary, slot.message.name);
            (slot.name.to_string(), json!({ "type": "string", "description": about }))
        })
        .collect();
    let inputs = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    if let Some(object) = schema.as_object_mut() {
        let properties = object.entry("properties").or_insert_with(|| json!({}));
        if let Some(properties) = properties.as_object_mut() {
            properties.insert("inputs".into(), inputs);
        }
    }
}

/// Schema that includes others.
struct Whole {
    json: Json,
}

impl Whole {
    fn new(mut json: Json, title: &str) -> Whole {
        if let Some(object) = json.as_object_mut() {
            object.insert("$schema".into(), DIALECT.into());
            object.insert("title".into(), title.into());
            object.insert("additionalProperties".into(), false.into());
        }
        Whole { json }
    }

    /// Adds a schema to the definitions, and returns a reference to it.
    fn include(&mut self, name: &str, mut schema: Json) -> Json {
        if let Some(object) = schema.as_object_mut() {
            object.remove("$schema");
            object.remove("title");
            // Common keys and plugin keys share one table: neither part may forbid the keys of the other.
            object.remove("additionalProperties");
        }
        let inner = schema.as_object_mut().and_then(|object| object.remove("$defs"));
        let inner = match inner {
            Some(Json::Object(inner)) => inner,
            _ => Map::new(),
        };
        rename_references(&mut schema, name);
        let Some(object) = self.json.as_object_mut() else { return json!(true) };
        let definitions = object.entry("$defs").or_insert_with(|| json!({}));
        if let Some(definitions) = definitions.as_object_mut() {
            for (key, mut part) in inner {
                rename_references(&mut part, name);
                definitions.insert(format!("{name}.{key}"), part);
            }
            definitions.insert(name.to_owned(), schema);
        }
        json!({ "$ref": format!("#/$defs/{name}") })
    }

    /// Adds a part that refers to other definitions, and returns a reference to it.
    fn define(&mut self, name: &str, part: Json) -> Json {
        if let Some(definitions) = self.json.get_mut("$defs").and_then(Json::as_object_mut) {
            definitions.insert(name.to_owned(), part);
        }
        json!({ "$ref": format!("#/$defs/{name}") })
    }

    fn set(&mut self, key: &str, mut part: Json) {
        let Some(properties) = self.json.get_mut("properties").and_then(Json::as_object_mut) else { return };
        let about = properties.get(key).and_then(|old| old.get("description")).cloned();
        if let (Some(about), Some(object)) = (about, part.as_object_mut()) {
            object.insert("description".into(), about);
        }
        properties.insert(key.to_owned(), part);
    }
}

/// Renames the references of an included schema.
fn rename_references(schema: &mut Json, name: &str) {
    match schema {
        Json::Object(object) => {
            for (key, part) in object.iter_mut() {
                match part {
                    Json::String(target) if key == "$ref" => {
                        if let Some(old) = target.strip_prefix("#/$defs/") {
                            *target = format!("#/$defs/{name}.{old}");
                        }
                    }
                    part => rename_references(part, name),
                }
            }
        }
        Json::Array(parts) => parts.iter_mut().for_each(|part| rename_references(part, name)),
        _ => {}
    }
}
