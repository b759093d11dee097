//! One difference between a recorded and a replayed message: its author, its axes and its fields.

use serde::Serialize;
use serde_json::Value;
use yamabico_core::message::MessageType;

use crate::record::to_json;

/// Maximum number of fields that are listed.
const MAX_FIELDS: usize = 12;
/// Author of decisions, commands and goals.
pub(super) const ARBITER: &str = "arbiter";

/// A field that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldDifference {
    /// Path of the field, such as `twist.linear`.
    pub field: String,
    /// Recorded value.
    pub recorded: Value,
    /// Replayed value.
    pub replayed: Value,
}

/// Author of the messages on `topic`.
pub(super) fn author(topic: &str) -> &str {
    topic.strip_prefix("behaviors/").and_then(|rest| rest.split('/').next()).unwrap_or(ARBITER)
}

/// Fields in which two messages of one type differ; the bytes themselves if no field shows it.
pub(super) fn fields(
    message: &MessageType,
    recorded: (&[u8], &[u8]),
    replayed: (&[u8], &[u8]),
) -> Vec<FieldDifference> {
    let json = |(header, items): (&[u8], &[u8])| to_json(message, header, items);
    let mut found = Vec::new();
    compare(String::new(), &json(recorded), &json(replayed), &mut found);
    if found.is_empty() {
        // Such as the sign of a zero, or the pixels of an image.
        let first = |a: &[u8], b: &[u8]| a.iter().zip(b).position(|(a, b)| a != b);
        let at = first(recorded.0, replayed.0).map(|at| format!("byte {at} of the header"));
        let at = at.or_else(|| first(recorded.1, replayed.1).map(|at| format!("byte {at} of the items")));
        let field = at.unwrap_or_else(|| "length".to_owned());
        let lengths = |(header, items): (&[u8], &[u8])| Value::from(header.len() + items.len());
        found.push(FieldDifference { field, recorded: lengths(recorded), replayed: lengths(replayed) });
    }
    found
}

/// Axes that the fields are about, such as `["linear"]`.
pub(super) fn axes(fields: &[FieldDifference]) -> Vec<String> {
    let named = ["linear", "lateral", "angular"].into_iter();
    let is_in = |axis: &str| fields.iter().any(|field| field.field.split('.').any(|part| part == axis));
    named.filter(|axis| is_in(axis)).map(str::to_owned).collect()
}

fn compare(path: String, a: &Value, b: &Value, found: &mut Vec<FieldDifference>) {
    if a == b || found.len() >= MAX_FIELDS || path.ends_with("_hex") || path.ends_with("_text") {
        return;
    }
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            for (name, value) in a {
                compare(below(name), value, b.get(name).unwrap_or(&Value::Null), found);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                // Verdicts are known by their behavior.
                let name = a.get("behavior").and_then(Value::as_str).map(str::to_owned);
                compare(below(&name.unwrap_or_else(|| i.to_string())), a, b, found);
            }
        }
        _ => found.push(FieldDifference { field: path, recorded: a.clone(), replayed: b.clone() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::bytes_of;
    use yamabico_core::message::{Axes, Proposal, Twist};

    #[test]
    fn a_difference_names_its_fields_and_axes() {
        let message = MessageType::of::<Proposal>();
        let a = Proposal::drive(Axes::PLANAR, Twist::planar(0.3, 0.1));
        let b = Proposal { twist: Twist::planar(0.3 + 1e-9, 0.1), ..a };
        let found = fields(&message, (bytes_of(&a), &[]), (bytes_of(&b), &[]));
        assert_eq!((found.len(), found[0].field.as_str()), (1, "twist.linear"));
        assert_eq!(
            (axes(&found), author("behaviors/follower/proposal")),
            (vec!["linear".to_owned()], "follower")
        );
        let b = Proposal { twist: Twist::planar(0.3, 0.1), ..a };
        assert_eq!(bytes_of(&a), bytes_of(&b));
        let b = Proposal { twist: Twist { lateral: -0.0, ..a.twist }, ..a };
        let found = fields(&message, (bytes_of(&a), &[]), (bytes_of(&b), &[]));
        assert!(!found.is_empty() && author("command") == "arbiter", "{found:?}");
    }
}
