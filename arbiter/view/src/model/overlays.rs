//! Newest overlays: what behaviors drew over the pictures that they saw.

use std::collections::VecDeque;
use std::sync::Arc;

use serde_json::{Value, json};

/// Number of newest overlays that are kept, of all behaviors together.
const KEPT: usize = 48;
/// Codes of the marks that begin a layer: in pixels and in the robot frame.
const LAYERS: [(u64, &str); 2] = [(0, "image"), (1, "robot")];

/// Overlay of one behavior over one message.
#[derive(Clone, Debug, PartialEq)]
struct Overlay {
    behavior: String,
    topic: String,
    stamp_ns: u64,
    layers: Arc<Value>,
}

/// Newest overlays.
#[derive(Clone, Debug, Default)]
pub struct Overlays {
    kept: VecDeque<Overlay>,
}

impl Overlays {
    /// Takes in the message on `topic`, as JSON.
    pub(super) fn add(&mut self, topic: &str, message: &Value) {
        let behavior = topic.split('/').nth(1).unwrap_or(topic).to_owned();
        let text = |field: &str| message.get(field).and_then(Value::as_str).unwrap_or_default().to_owned();
        let Some(stamp_ns) = message.get("stamp_ns").and_then(Value::as_u64) else { return };
        let overlay = Overlay { behavior, topic: text("topic"), stamp_ns, layers: layers(message).into() };
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(overlay);
    }

    /// Overlays over the message on `topic` with this stamp, one a behavior: its name and its layers.
    pub fn over(&self, topic: &str, stamp_ns: u64) -> Vec<Value> {
        let of_message = self.kept.iter().filter(|kept| kept.topic == topic && kept.stamp_ns == stamp_ns);
        of_message.map(|kept| json!({ "behavior": kept.behavior, "layers": *kept.layers })).collect()
    }

    /// Returns true if there is an overlay over the message on `topic` with this stamp.
    pub(super) fn has(&self, topic: &str, stamp_ns: u64) -> bool {
        self.kept.iter().any(|kept| kept.topic == topic && kept.stamp_ns == stamp_ns)
    }
}

/// Layers with their marks: kind, coordinates and text.
fn layers(message: &Value) -> Value {
    let mut layers: Vec<Value> = Vec::new();
    for mark in message.get("items").and_then(Value::as_array).into_iter().flatten() {
        let kind = mark["kind"].as_u64().unwrap_or(u64::MAX);
        if let Some((_, space)) = LAYERS.iter().find(|(code, _)| *code == kind) {
            let color = format!("#{:06x}", mark["color"].as_u64().unwrap_or(0) & 0xff_ffff);
            layers.push(json!({ "name": mark["text"], "space": space, "color": color, "marks": [] }));
        } else if let Some(marks) = layers.last_mut().and_then(|layer| layer["marks"].as_array_mut()) {
            marks.push(json!([kind, mark["x"], mark["y"], mark["x2"], mark["y2"], mark["text"]]));
        }
    }
    layers.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlays_are_found_by_their_frame_and_bounded() {
        let mut overlays = Overlays::default();
        let message = |stamp: u64| {
            let layer = json!({ "kind": 0, "color": 0xff_46e6, "text": "edges" });
            let line = json!({ "kind": 3, "x": 1.0, "y": 2.0, "x2": 3.0, "y2": 4.0, "text": "" });
            json!({ "stamp_ns": stamp, "topic": "sensors/front", "items": [line.clone(), layer, line] })
        };
        for stamp in 0..200 {
            overlays.add("behaviors/wall/overlay", &message(stamp));
        }
        assert_eq!(overlays.kept.len(), KEPT);
        let found = overlays.over("sensors/front", 199);
        let layer = json!({ "name": "edges", "space": "image", "color": "#ff46e6",
            "marks": [[3, 1.0, 2.0, 3.0, 4.0, ""]] });
        assert_eq!(found, [json!({ "behavior": "wall", "layers": [layer] })]);
        assert!(overlays.over("sensors/rear", 199).is_empty() && !overlays.has("sensors/front", 3));
        overlays.add("x", &json!(7));
    }
}
