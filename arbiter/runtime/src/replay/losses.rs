//! Messages that a recording lacks, by the gaps in their numbers.

use std::collections::BTreeMap;

use yamabico_core::message::Channel;

use super::steps::RecordedMessage;
use super::window::key;

/// Counts lost messages of streams. Numbers that go back are those of a new publisher.
#[derive(Default)]
pub(super) struct Losses {
    last: BTreeMap<String, u64>,
    lost: BTreeMap<String, u64>,
}

impl Losses {
    /// Takes in a recorded message.
    pub fn count(&mut self, message: &RecordedMessage) {
        let is_counted = message.message.channel == Channel::Stream && !is_shared(&message.topic);
        if !is_counted {
            return;
        }
        let number = key(message).0;
        let Some(last) = self.last.get_mut(&message.topic) else {
            self.last.insert(message.topic.clone(), number);
            return;
        };
        let lost = number.saturating_sub(*last + 1);
        *last = number;
        if lost > 0 {
            *self.lost.entry(message.topic.clone()).or_default() += lost;
        }
    }

    /// Number of lost messages by topic, for people; `None` if none is lost.
    pub fn note(&self) -> Option<String> {
        let total: u64 = self.lost.values().sum();
        let topics: Vec<String> =
            self.lost.iter().map(|(topic, lost)| format!("{lost} on {topic}")).collect();
        (total > 0).then(|| format!("the recording lacks {total} messages: {}", topics.join(", ")))
    }
}

/// Returns true for a topic with several publishers, each of which counts for itself.
fn is_shared(topic: &str) -> bool {
    topic.starts_with("plugins/") || topic.starts_with("clock/") || topic == yamabico_host::topics::CONTROL
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{MessageType, Odometry};

    #[test]
    fn gaps_are_counted_and_new_publishers_are_none() {
        let mut losses = Losses::default();
        for (topic, numbers) in [("wheels", &[1, 2, 5, 6, 1, 2, 4][..]), ("plugins/calls", &[1, 9])] {
            for &sequence in numbers {
                let header = Odometry { sequence, ..Odometry::default() };
                losses.count(&RecordedMessage {
                    topic: topic.into(),
                    message: MessageType::of::<Odometry>(),
                    header: bytemuck::bytes_of(&header).to_vec(),
                    items: Vec::new(),
                });
            }
        }
        assert_eq!(losses.note().unwrap(), "the recording lacks 3 messages: 3 on wheels");
        assert!(Losses::default().note().is_none());
    }
}
