//! JSON form of a recorded message, and its JSON Schema.

use serde_json::{Value, json};
use yamabico_core::message::{MessageDeclaration, MessageType};

use super::code_text;

pub(super) const HEADER_BYTES: &str = "header_hex";
pub(super) const ITEM_BYTES: &str = "items_hex";
/// Key of the layout of a message type that a plugin declares.
const LAYOUT: &str = "x-yamabico-layout";

/// Converts a message to JSON: the header's fields, its items under `items`, and the text of each code under `..._text`.
///
/// Numbers have full precision. JSON cannot express a number that is not finite: it is null, and the bytes of header and items
/// follow in hexadecimal under `header_hex` and `items_hex`, so that nothing is lost. Pixels are left out.
pub fn to_json(message: &MessageType, header: &[u8], items: &[u8]) -> Value {
    let mut value = message.to_json(header, items);
    if has_null(&value)
        && let Some(object) = value.as_object_mut()
    {
        object.insert(HEADER_BYTES.into(), hexadecimal(header).into());
        object.insert(ITEM_BYTES.into(), hexadecimal(items).into());
    }
    code_text::add_texts(message, &mut value);
    value
}

/// Bytes of a message.
pub struct Bytes {
    /// Header.
    pub header: Vec<u8>,
    /// Items; of a frame none.
    pub items: Vec<u8>,
}

/// Converts the JSON of [`to_json`] back to a message; `None` if it does not fit.
pub fn from_json(message: &MessageType, json: &Value) -> Option<Bytes> {
    let raw = |name: &str| json.get(name)?.as_str().and_then(bytes_of_hexadecimal);
    let (header, items) = match raw(HEADER_BYTES) {
        Some(header) => (header, raw(ITEM_BYTES)?),
        None => message.from_json(json)?,
    };
    let is_whole = header.len() == message.header_size && items.len() % message.item_size.max(1) == 0;
    is_whole.then_some(Bytes { header, items })
}

/// Bytes from two digits each; `None` for anything else.
pub(super) fn bytes_of_hexadecimal(hexadecimal: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u32>> = hexadecimal.chars().map(|digit| digit.to_digit(16)).collect();
    let digits = digits.filter(|digits| digits.len() % 2 == 0)?;
    Some(digits.chunks(2).map(|pair| (pair[0] * 16 + pair[1]) as u8).collect())
}

fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(items) => items.iter().any(has_null),
        Value::Object(fields) => fields.values().any(has_null),
        _ => false,
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    let digit = |half: u8| char::from_digit(u32::from(half), 16).unwrap_or('?');
    bytes.iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 15)]).collect()
}

/// JSON Schema of [`to_json`]'s values, derived from a message of zeros: a message always has the same fields.
pub(super) fn of(message: &MessageType) -> Value {
    let example = to_json(message, &vec![0; message.header_size], &vec![0; message.item_size]);
    let mut schema = describe(&example);
    schema["title"] = json!(message.name);
    schema["$comment"] = json!("A number that is not finite is null, and the bytes follow in hexadecimal.");
    for name in [HEADER_BYTES, ITEM_BYTES] {
        schema["properties"][name] = json!({ "type": "string" });
    }
    if !message.is_built_in() {
        schema[LAYOUT] = json!(message.declaration());
    }
    schema
}

/// Message type of a recorded topic, by the name and the text of its JSON Schema; `None` for a topic that holds something else.
///
/// # Errors
/// The type is of another version, or its declaration is invalid.
pub fn message_type(name: &str, schema: &[u8]) -> Option<Result<&'static MessageType, String>> {
    if let Some(known) = MessageType::find(name).filter(|known| known.is_built_in()) {
        return Some(Ok(known));
    }
    if name.starts_with("yamabico.") {
        return Some(Err(MessageType::unknown(name)));
    }
    let layout = serde_json::from_slice::<Value>(schema).ok()?.get_mut(LAYOUT)?.take();
    let declared =
        serde_json::from_value::<MessageDeclaration>(layout).map_err(|error| format!("`{name}`: {error}"));
    Some(declared.and_then(|declaration| MessageType::declare(&declaration)))
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
    use yamabico_core::message::{ALL, DecisionHeader, RangeScanHeader, Truth};

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
    fn numbers_that_json_cannot_express_are_there_as_bytes() {
        let truth = Truth { stamp_ns: 0x01a2, person_m: f64::INFINITY, ..Truth::default() };
        let message = MessageType::of::<Truth>();
        let value = to_json(&message, bytemuck::bytes_of(&truth), &[]);
        assert!(value["person_m"].is_null() && value["items_hex"] == "");
        let hex = value["header_hex"].as_str().unwrap();
        assert_eq!((&hex[..6], hex.len()), ("a20100", 2 * size_of::<Truth>()));
        assert_eq!(from_json(&message, &value).unwrap().header, bytemuck::bytes_of(&truth));
        assert!(bytes_of_hexadecimal("a").is_none() && bytes_of_hexadecimal("0g").is_none());
        let finite = to_json(&message, bytemuck::bytes_of(&Truth::default()), &[]);
        assert!(finite.get("header_hex").is_none());
    }

    #[test]
    fn lists_and_texts_are_described() {
        let scan = of(&MessageType::of::<RangeScanHeader>());
        assert_eq!(scan["properties"]["items"]["items"]["properties"]["range_m"]["type"], "number");
        assert_eq!(scan["properties"]["stamp_ns"]["type"], "integer");
        let decision = of(&MessageType::of::<DecisionHeader>());
        assert_eq!(decision["properties"]["mode_text"]["type"], "string");
        assert_eq!(decision["properties"]["items"]["items"]["properties"]["outcome_text"]["type"], "string");
    }
}
