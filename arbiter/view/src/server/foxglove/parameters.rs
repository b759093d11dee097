//! Parameters of the behaviors as a viewer knows them, such as `wall-follower.speed_mps`.

use serde_json::{Value, json};

use crate::model::BehaviorParameters;
use crate::server::command::Command;

/// A parameter with its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameter {
    pub name: String,
    pub value: Value,
    /// Set if its numbers may have a fraction.
    is_real: bool,
}

/// Parameters of these behaviors that have a value.
pub(super) fn of(behaviors: &[BehaviorParameters]) -> Vec<Parameter> {
    let all = behaviors.iter().flat_map(|behavior| {
        behavior.parameters.iter().filter_map(|entry| {
            Some(Parameter {
                name: format!("{}.{}", behavior.behavior, entry.key),
                value: entry.value.clone().filter(|value| !value.is_null())?,
                is_real: entry.takes != "integer",
            })
        })
    });
    all.collect()
}

impl Parameter {
    /// JSON of the protocol; a real number that is whole is marked as such.
    pub fn to_json(&self) -> Value {
        let mut json = json!({ "name": self.name, "value": self.value });
        let is_number_list = |items: &Vec<Value>| !items.is_empty() && items.iter().all(Value::is_number);
        let kind = match &self.value {
            Value::Number(_) => "float64",
            Value::Array(items) if is_number_list(items) => "float64_array",
            _ => return json,
        };
        if self.is_real {
            json["type"] = kind.into();
        }
        json
    }
}

/// Command that sets the parameter `name`; `None` if the name has no key.
pub(super) fn set(name: &str, value: Value) -> Option<Command> {
    let (behavior, key) = name.split_once('.')?;
    Some(Command::Set { behavior: behavior.to_owned(), key: key.to_owned(), value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_runtime::execution::ParameterEntry;

    #[test]
    fn real_numbers_are_marked_and_absent_values_left_out() {
        let entry = |key: &str, takes: &str, value: Value| ParameterEntry {
            key: key.to_owned(),
            takes: takes.to_owned(),
            unit: None,
            range: None,
            value: Some(value),
            summary: String::new(),
        };
        let parameters = vec![
            entry("speed_mps", "number", json!(1)),
            entry("gate.count", "integer", json!(3)),
            entry("route", "array", json!([1, 2.5])),
            entry("method", "\"a\" | \"b\"", json!("a")),
            entry("map", "string", Value::Null),
        ];
        let behavior = BehaviorParameters { behavior: "wall".to_owned(), parameters };
        let all: Vec<_> = of(&[behavior]).iter().map(Parameter::to_json).collect();
        assert_eq!(all.len(), 4);
        assert_eq!(all[0], json!({ "name": "wall.speed_mps", "type": "float64", "value": 1 }));
        assert_eq!(all[1], json!({ "name": "wall.gate.count", "value": 3 }));
        assert_eq!((&all[2]["type"], all[3].get("type")), (&json!("float64_array"), None));
        let command = set("wall.gate.count", json!(4)).unwrap();
        assert!(
            matches!(command, Command::Set { behavior, key, .. } if behavior == "wall" && key == "gate.count")
        );
        assert!(set("wall", json!(1)).is_none());
    }
}
