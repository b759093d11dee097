//! A JSON Schema as the checks and descriptions look at it.

use std::collections::BTreeSet;

use serde_json::Value as Json;

/// A schema, or a part of one, and the whole in which its references are found.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    pub part: &'a Json,
    pub whole: &'a Json,
}

impl<'a> Shape<'a> {
    pub fn new(schema: &'a Json) -> Shape<'a> {
        Shape { part: schema, whole: schema }
    }

    pub fn at(self, part: &'a Json) -> Shape<'a> {
        Shape { part, ..self }.resolved()
    }

    /// With references followed, and "or nothing" left out: an absent key says that in TOML.
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

    /// The branches of an `anyOf` or `oneOf` without null.
    pub fn alternatives(self) -> Vec<Shape<'a>> {
        let branches = self.part.get("anyOf").or_else(|| self.part.get("oneOf")).and_then(Json::as_array);
        let branches = branches.into_iter().flatten();
        let null = |part: &&Json| part.get("type").and_then(Json::as_str) == Some("null");
        branches.filter(|part| !null(part)).map(|part| Shape { part, ..self }).collect()
    }

    /// Properties of this and of every `allOf` branch.
    pub fn properties(self) -> Vec<(&'a str, Shape<'a>)> {
        let own = self.part.get("properties").and_then(Json::as_object).into_iter().flatten();
        let mut all: Vec<_> = own.map(|(key, part)| (key.as_str(), Shape { part, ..self })).collect();
        for part in self.part.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            all.extend(self.at(part).properties());
        }
        all
    }

    /// Keys that must be there, of this and of every `allOf` branch.
    pub fn required(self) -> BTreeSet<&'a str> {
        let own = self.part.get("required").and_then(Json::as_array).into_iter().flatten();
        let mut all: BTreeSet<_> = own.filter_map(Json::as_str).collect();
        for part in self.part.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            all.extend(self.at(part).required());
        }
        all
    }

    /// What every value of a table with free keys must be.
    pub fn free_keys(self) -> Option<Shape<'a>> {
        let part = self.part.get("additionalProperties").filter(|part| part.is_object())?;
        Some(self.at(part))
    }

    /// The words that a text may be; empty where any text will do.
    pub fn words(self) -> Vec<&'a str> {
        let enumerated = self.part.get("enum").and_then(Json::as_array).into_iter().flatten();
        let mut words: Vec<&str> =
            enumerated.chain(self.part.get("const")).filter_map(Json::as_str).collect();
        for branch in self.alternatives() {
            words.extend(branch.resolved().words());
        }
        words
    }

    /// The names of the types that a value may have; empty where any will do.
    pub fn types(self) -> Vec<&'a str> {
        let types = match self.part.get("type") {
            Some(Json::String(name)) => vec![name.as_str()],
            Some(Json::Array(names)) => names.iter().filter_map(Json::as_str).collect(),
            _ => Vec::new(),
        };
        types.into_iter().filter(|name| *name != "null").collect()
    }

    pub fn bound(self, name: &str) -> Option<f64> {
        self.part.get(name).and_then(Json::as_f64)
    }

    pub fn text(self, name: &str) -> Option<&'a str> {
        self.part.get(name).and_then(Json::as_str)
    }
}
