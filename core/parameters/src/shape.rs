//! View of a JSON Schema for checks and descriptions.

use std::collections::BTreeSet;

use serde_json::Value as Json;

/// Schema, or part of one, with the document that resolves its references.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// Schema or part of it.
    pub part: &'a Json,
    /// Document in which references are resolved.
    pub whole: &'a Json,
}

impl<'a> Shape<'a> {
    /// Creates a view of a whole schema.
    pub fn new(schema: &'a Json) -> Shape<'a> {
        Shape { part: schema, whole: schema }
    }

    /// Returns a view of another part of the same document.
    pub fn at(self, part: &'a Json) -> Shape<'a> {
        Shape { part, ..self }.resolved()
    }

    /// Follows references and removes null alternatives, which TOML expresses by an absent key.
    pub fn resolved(self) -> Shape<'a> {
        let mut shape = self;
        for _ in 0..16 {
            let target = shape.part.get("$ref").and_then(Json::as_str);
            let part = match target.and_then(|target| target.strip_prefix('#')) {
                Some(pointer) => shape.whole.pointer(pointer),
                None => match shape.alternatives().as_slice() {
                    [only] => Some(only.part),
                    _ => None,
                },
            };
            let Some(part) = part else { break };
            shape.part = part;
        }
        shape
    }

    /// Returns the branches of an `anyOf` or `oneOf` without null.
    pub fn alternatives(self) -> Vec<Shape<'a>> {
        let branches = self.part.get("anyOf").or_else(|| self.part.get("oneOf")).and_then(Json::as_array);
        let branches = branches.into_iter().flatten();
        let null = |part: &&Json| part.get("type").and_then(Json::as_str) == Some("null");
        branches.filter(|part| !null(part)).map(|part| Shape { part, ..self }).collect()
    }

    /// Returns the properties of this and of every `allOf` branch.
    pub fn properties(self) -> Vec<(&'a str, Shape<'a>)> {
        let own = self.part.get("properties").and_then(Json::as_object).into_iter().flatten();
        let mut all: Vec<_> = own.map(|(key, part)| (key.as_str(), Shape { part, ..self })).collect();
        for part in self.part.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            all.extend(self.at(part).properties());
        }
        all
    }

    /// Returns the required keys of this and of every `allOf` branch.
    pub fn required(self) -> BTreeSet<&'a str> {
        let own = self.part.get("required").and_then(Json::as_array).into_iter().flatten();
        let mut all: BTreeSet<_> = own.filter_map(Json::as_str).collect();
        for part in self.part.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            all.extend(self.at(part).required());
        }
        all
    }

    /// Returns the schema of the values of a table with arbitrary keys.
    pub fn free_keys(self) -> Option<Shape<'a>> {
        let part = self.part.get("additionalProperties").filter(|part| part.is_object())?;
        Some(self.at(part))
    }

    /// Returns the allowed strings; empty if any string is allowed.
    pub fn words(self) -> Vec<&'a str> {
        let enumerated = self.part.get("enum").and_then(Json::as_array).into_iter().flatten();
        let mut words: Vec<&str> =
            enumerated.chain(self.part.get("const")).filter_map(Json::as_str).collect();
        for branch in self.alternatives() {
            words.extend(branch.resolved().words());
        }
        words
    }

    /// Returns the names of the allowed types; empty if any type is allowed.
    pub fn types(self) -> Vec<&'a str> {
        let types = match self.part.get("type") {
            Some(Json::String(name)) => vec![name.as_str()],
            Some(Json::Array(names)) => names.iter().filter_map(Json::as_str).collect(),
            _ => Vec::new(),
        };
        types.into_iter().filter(|name| *name != "null").collect()
    }

    /// Returns the number under `name`, such as `minimum`.
    pub fn bound(self, name: &str) -> Option<f64> {
        self.part.get(name).and_then(Json::as_f64)
    }

    /// Returns the string under `name`, such as `description`.
    pub fn text(self, name: &str) -> Option<&'a str> {
        self.part.get(name).and_then(Json::as_str)
    }
}
