//! The last seconds of a recording, in which a message is found by its topic and number.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

use yamabico_core::time::Time;

use super::steps::RecordedMessage;

/// Time for which messages are kept, s: longer than any call waits for its inputs.
const KEPT_S: f64 = 5.0;
/// Maximum size of the kept messages, bytes.
const MAX_BYTES: usize = 512 << 20;

/// Sequence number and stamp of a message.
pub(super) type Key = (u64, u64);

/// Messages of the last seconds.
#[derive(Default)]
pub(super) struct Window {
    topics: BTreeMap<String, VecDeque<(Key, Rc<RecordedMessage>)>>,
    /// Time and topic of every kept message, oldest first.
    order: VecDeque<(Time, String, usize)>,
    bytes: usize,
}

/// Key of a message.
pub(super) fn key(message: &RecordedMessage) -> Key {
    ((message.message.sequence)(&message.header), (message.message.stamps)(&message.header).0.0)
}

impl Window {
    /// Adds a message that was recorded at `time`, and drops what is too old.
    pub fn push(&mut self, time: Time, message: RecordedMessage) -> Rc<RecordedMessage> {
        let bytes = message.header.len() + message.items.len();
        let (topic, message) = (message.topic.clone(), Rc::new(message));
        self.topics.entry(topic.clone()).or_default().push_back((key(&message), message.clone()));
        self.order.push_back((time, topic, bytes));
        self.bytes += bytes;
        while let Some((oldest, topic, bytes)) = self.order.front()
            && (time.seconds_after(*oldest) > KEPT_S || self.bytes > MAX_BYTES)
        {
            self.bytes -= bytes;
            if let Some(messages) = self.topics.get_mut(topic) {
                messages.pop_front();
            }
            self.order.pop_front();
        }
        message
    }

    /// Number of kept messages on `topic` that were recorded after `time`.
    pub fn count_after(&self, topic: &str, time: Time) -> u64 {
        self.order.iter().filter(|(recorded, known, _)| *recorded > time && known == topic).count() as u64
    }

    /// Newest message on `topic` with this key.
    pub fn find(&self, topic: &str, key: Key) -> Option<&Rc<RecordedMessage>> {
        self.search(topic, |known, _| *known == key)
    }

    /// Newest message on `topic` that fits.
    pub fn search(
        &self,
        topic: &str,
        fits: impl Fn(&Key, &RecordedMessage) -> bool,
    ) -> Option<&Rc<RecordedMessage>> {
        let messages = self.topics.get(topic)?;
        messages.iter().rev().find(|(key, message)| fits(key, message)).map(|(_, message)| message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{MessageType, Odometry};

    #[test]
    fn messages_are_found_by_number_until_they_are_too_old() {
        let mut window = Window::default();
        let odometry = |sequence: u64| RecordedMessage {
            topic: "wheels".into(),
            message: MessageType::of::<Odometry>(),
            header: bytemuck::bytes_of(&Odometry { sequence, stamp_ns: 10 * sequence, ..Default::default() })
                .to_vec(),
            items: Vec::new(),
        };
        for sequence in 0..100 {
            window.push(Time::from_secs_f64(sequence as f64 * 0.1), odometry(sequence));
        }
        assert!(window.find("wheels", (99, 990)).is_some() && window.find("wheels", (60, 600)).is_some());
        assert!(window.find("wheels", (99, 991)).is_none() && window.find("sonar", (99, 990)).is_none());
        assert!(window.find("wheels", (10, 100)).is_none(), "it is ten seconds old");
        let after = |topic| window.count_after(topic, Time::from_secs_f64(9.75));
        assert_eq!((after("wheels"), after("sonar")), (2, 0));
    }
}
