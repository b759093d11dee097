//! JSON Schemas of configuration files, for editors.

mod composite;
mod robot;

use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value as Json, json};

use super::exec::{ask_behavior, read_tree};
use super::load::external_drivers;
use super::tables::{BehaviorKeys, TaskKeys};
use composite::{Composite, closed, describe_as, free_with_exec, has_program, when};
use robot::{robot_part, schema_of_robots};
use yamabico_core::behavior::{BehaviorFactory, BehaviorInfo, SlotInfo};
use yamabico_core::plugins::Plugins;

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

/// Returns the same schemas with the keys of external programs: those that are behaviors of the task file `task`, and those
/// that are drivers in the robot file `robot`.
///
/// # Errors
/// A file cannot be read, or a program does not describe itself.
pub fn schema_with_programs(
    task: Option<&Path>,
    robot: Option<&Path>,
    plugins: &Plugins,
) -> Result<Json, String> {
    let mut kinds = schema(plugins);
    if let Some(path) = task {
        let tree = read_tree(path)?;
        let entries = tree.table("behaviors").map_or(&[][..], |behaviors| behaviors.entries.as_slice());
        let asked = entries.iter().filter_map(|entry| Some((entry.key.clone(), ask_behavior(entry, path)?)));
        let programs =
            asked.map(|(name, factory)| Ok((name, factory?))).collect::<Result<Vec<_>, String>>()?;
        kinds["task"] = schema_of_tasks(plugins, &programs);
    }
    if let Some(path) = robot {
        let programs = external_drivers(path).map_err(|problems| problems.to_string())?;
        let robot = schema_of_robots(plugins, &programs);
        kinds["robot_part"] = robot_part(robot.clone());
        kinds["robot"] = robot;
    }
    Ok(kinds)
}

/// Returns the JSON Schema of a task file.
pub fn task_schema(plugins: &Plugins) -> Json {
    schema_of_tasks(plugins, &[])
}

/// Returns the JSON Schema of a task file; `programs` are behaviors by name that are external programs.
fn schema_of_tasks(plugins: &Plugins, programs: &[(String, Arc<dyn BehaviorFactory>)]) -> Json {
    let mut whole = Composite::new(schemars::schema_for!(TaskKeys).to_value(), "A task of Yamabico");
    let common = whole.include("behavior", schemars::schema_for!(BehaviorKeys).to_value());
    let mut choices = vec![common.clone(), free_with_exec()];
    let mut unnamed = Vec::new();
    for behavior in &plugins.behaviors {
        let plugin = behavior.info();
        let own = whole.include(&format!("behavior.{}", plugin.name), own_keys(plugin));
        choices.push(when(&[("type", &plugin.name)], own.clone()));
        let is_unnamed = json!({ "not": { "anyOf": [{ "required": ["type"] }, has_program()] } });
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
    schema_of_robots(plugins, &[])
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
