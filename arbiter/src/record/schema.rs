//! JSON of a message as it is recorded, and its JSON Schema.

use serde_json::{Value, json};
use yamabico_core::message::MessageType;

use super::words;

/// The message as JSON: the header's fields, its items under `items`, and each code once more in words under `..._text`.
/// Numbers have full precision; one that is not finite is null. Pixels are left out.
pub(super) fn to_json(message: &MessageType, header: &[u8], items: &[u8]) -> Value {
    let mut value = (message.to_json)(header, items);
    words::explain(message, &mut value);
    value
}

/// The JSON Schema of [`to_json`]'s values, read off a message of zeros: a message has always the same fields.
pub(super) fn of(message: &MessageType) -> Value {
    let example = to_json(message, &vec![0; message.header_size], &vec![0; message.item_size]);
    let mut schema = describe(&example);
    schema["title"] = json!(message.name);
    schema["$comment"] = json!("A number that is not finite is null.");
    schema
}

fn describe(example: &Value) -> Value {
    match example {
        Value::Object(fields) => {
            let properties: serde_json::Map<_, _> =
                fields.iter().map(|(name, value)| (name.clone(), describe(value))).collect();
            json!({ "type": "object", "properties": properties })
        }
        Value::Array(items) => json!({
            "type": "array",
            "items": items.first().map_or_else(|| json!({ "type": "object" }), describe),
        }),
        Value::String(_) => json!({ "type": "string" }),
        Value::Number(number) if number.is_f64() => json!({ "type": "number" }),
        Value::Number(_) => json!({ "type": "integer" }),
        Value::Bool(_) => json!({ "type": "boolean" }),
        Value::Null => json!({}),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{ALL, DecisionHeader, RangeScanHeader};

    #[test]
    fn every_message_has_a_schema_that_names_all_its_fields() {
        for message in ALL {
            let schema = of(message);
            assert_eq!(schema["type"], "object", "{}", message.name);
            let example = to_json(message, &vec![0; message.header_size], &vec![0; message.item_size]);
            for field in example.as_object().unwrap().keys() {
                let kind = &schema["properties"][field]["type"];
                assert!(kind.is_string(), "{}: {field}: {kind}", message.name);
            }
        }
    }

    #[test]
    fn lists_and_words_are_described() {
        let scan = of(&MessageType::of::<RangeScanHeader>());
        assert_eq!(scan["properties"]["items"]["items"]["properties"]["range_m"]["type"], "number");
        assert_eq!(scan["properties"]["stamp_ns"]["type"], "integer");
        let decision = of(&MessageType::of::<DecisionHeader>());
        assert_eq!(decision["properties"]["mode_text"]["type"], "string");
        assert_eq!(decision["properties"]["items"]["items"]["properties"]["outcome_text"]["type"], "string");
    }
}
