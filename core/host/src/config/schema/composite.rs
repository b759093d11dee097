//! JSON Schema composed of the schemas of several plugins.

use serde_json::{Map, Value as Json, json};

use super::super::exec::{ROS2_DRIVER, ROS2_KEYS};

const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

/// Schema composed of others.
pub(super) struct Composite {
    pub json: Json,
}

impl Composite {
    /// Creates a schema from that of the common keys.
    pub fn new(mut json: Json, title: &str) -> Composite {
        if let Some(object) = json.as_object_mut() {
            object.insert("$schema".into(), DIALECT.into());
            object.insert("title".into(), title.into());
            object.insert("additionalProperties".into(), false.into());
        }
        Composite { json }
    }

    /// Adds a schema to the definitions, and returns a reference to it.
    pub fn include(&mut self, name: &str, mut schema: Json) -> Json {
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

    /// Adds a schema with another description to the definitions, and returns a reference to it.
    pub fn describe(&mut self, name: &str, schema: &Json, summary: &str) -> Json {
        let mut schema = schema.clone();
        describe_as(&mut schema, summary);
        self.include(name, schema)
    }

    /// Adds a part that refers to other definitions, and returns a reference to it.
    pub fn define(&mut self, name: &str, part: Json) -> Json {
        if let Some(definitions) = self.json.get_mut("$defs").and_then(Json::as_object_mut) {
            definitions.insert(name.to_owned(), part);
        }
        json!({ "$ref": format!("#/$defs/{name}") })
    }

    /// Replaces a property; its description stays.
    pub fn set(&mut self, key: &str, mut part: Json) {
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

/// Allows any key if `exec` names a program, or a key stands for one: it defines its own keys.
pub(super) fn free_with_exec() -> Json {
    json!({ "if": has_program(), "then": { "additionalProperties": true } })
}

/// True for a table whose behavior or driver is an external program.
pub(super) fn has_program() -> Json {
    let keys = ROS2_KEYS.iter().map(|(key, _)| *key).chain(["exec"]);
    let mut choices: Vec<Json> = keys.map(|key| json!({ "required": [key] })).collect();
    choices.push(json!({ "properties": { "driver": { "const": ROS2_DRIVER } }, "required": ["driver"] }));
    json!({ "anyOf": choices })
}

/// Table with the keys of all `parts` and no others.
pub(super) fn closed(parts: Vec<Json>) -> Json {
    json!({ "type": "object", "allOf": parts, "unevaluatedProperties": false })
}

/// Applies `then` if every key of `keys` has its word.
pub(super) fn when(keys: &[(&str, &str)], then: Json) -> Json {
    let words: Map<String, Json> =
        keys.iter().map(|(key, word)| ((*key).to_owned(), json!({ "const": word }))).collect();
    let required: Vec<&str> = keys.iter().map(|(key, _)| *key).collect();
    json!({ "if": { "properties": words, "required": required }, "then": then })
}

/// Sets the description of a schema.
pub(super) fn describe_as(schema: &mut Json, summary: &str) {
    if let Some(object) = schema.as_object_mut() {
        object.insert("description".into(), summary.into());
    }
}
