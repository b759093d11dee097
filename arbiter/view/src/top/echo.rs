//! The newest message of one topic as lines of text.

use std::ops::ControlFlow;
use std::time::Duration;

use serde_json::Value;
use yamabico_runtime::client::{ClientError, RobotClient, TopicSubscriber};
use yamabico_runtime::record::to_json;

/// Maximum number of items of a list that are shown.
const MAX_ITEMS: usize = 8;

/// Follows one topic.
pub(super) struct Echo {
    topic: String,
    subscriber: TopicSubscriber,
}

impl Echo {
    /// Subscribes to `topic` of the running robot.
    pub fn open(robot: &str, topic: &str) -> Result<Echo, ClientError> {
        let subscriber = RobotClient::join(robot)?.subscribe(topic)?;
        Ok(Echo { topic: topic.to_owned(), subscriber })
    }

    /// Name of the topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Newest message, one field a line; `None` if there is no new one.
    pub fn newest(&mut self) -> Result<Option<Vec<String>>, ClientError> {
        let message = *self.subscriber.message();
        let mut newest = None;
        let _ = self.subscriber.receive(Duration::ZERO, &mut |received| {
            newest = Some(to_json(&message, received.sample.header(), received.sample.items()));
            ControlFlow::Continue(())
        })?;
        Ok(newest.map(|value| lines(&value)))
    }
}

/// One field a line; the text of a code stands for the code.
pub(super) fn lines(value: &Value) -> Vec<String> {
    let Some(fields) = value.as_object() else { return vec![value.to_string()] };
    let mut lines = Vec::new();
    for (name, value) in fields {
        let is_redundant = name == "reserved" || fields.contains_key(&format!("{name}_text"));
        match value {
            _ if is_redundant => {}
            Value::Array(items) => {
                lines.push(format!("{name}: {} items", items.len()));
                lines.extend(items.iter().take(MAX_ITEMS).map(|item| format!("  {item}")));
            }
            value => lines.push(format!("{}: {value}", name.trim_end_matches("_text"))),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_message_is_one_field_a_line() {
        let value = json!({ "kind": 3, "kind_text": "halt", "reserved": 0, "items": vec![1; 20] });
        let lines = lines(&value);
        assert_eq!((lines.len(), lines[0].as_str()), (2 + MAX_ITEMS, "items: 20 items"));
        assert!(lines.contains(&"kind: \"halt\"".to_owned()), "{lines:?}");
    }
}
