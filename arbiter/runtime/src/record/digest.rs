//! Digest of a run: one number that equal runs share.

use std::collections::BTreeMap;
use std::fmt::Write;

use sha2::{Digest as _, Sha256};
use yamabico_core::message::{Message, MessageType, OverlayHeader, SavedStateHeader};
use yamabico_core::time::Time;

use super::Tap;

/// SHA-256 over the topic, type name, header and items of all messages in order, and the number of messages on each topic.
/// Overlays do not count: behaviors draw only while overlays are viewed. Nor do saved states: they enter no decision.
///
/// Each part is preceded by its length (eight bytes, little endian), so that different runs hash different bytes.
#[derive(Clone, Debug, Default)]
pub struct Digest {
    hash: Sha256,
    counts: BTreeMap<String, u64>,
}

impl Digest {
    /// Digest of a run without messages.
    pub fn new() -> Digest {
        Digest::default()
    }

    /// Digest so far: 64 hexadecimal digits.
    pub fn hex(&self) -> String {
        let mut hex = String::with_capacity(64);
        for byte in self.hash.clone().finalize() {
            // Writing to a `String` cannot fail.
            let _ = write!(hex, "{byte:02x}");
        }
        hex
    }

    /// Number of messages on each topic.
    pub fn counts(&self) -> &BTreeMap<String, u64> {
        &self.counts
    }

    fn part(&mut self, bytes: &[u8]) {
        self.hash.update((bytes.len() as u64).to_le_bytes());
        self.hash.update(bytes);
    }
}

impl Tap for Digest {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if [OverlayHeader::NAME, SavedStateHeader::NAME].contains(&message.name) {
            return;
        }
        self.part(topic.as_bytes());
        self.part(message.name.as_bytes());
        self.part(header);
        self.part(items);
        match self.counts.get_mut(topic) {
            Some(count) => *count += 1,
            None => drop(self.counts.insert(topic.to_owned(), 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Imu, Odometry};

    fn digest(messages: &[(&str, MessageType, &[u8], &[u8])]) -> Digest {
        let mut digest = Digest::new();
        for (i, (topic, message, header, items)) in messages.iter().enumerate() {
            digest.message(topic, message, Time(i as u64), header, items);
        }
        digest
    }

    #[test]
    fn the_empty_run_has_the_known_digest() {
        let known = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        assert_eq!(Digest::new().hex(), known);
    }

    #[test]
    fn order_topic_type_header_and_items_count() {
        let (odometry, imu) = (MessageType::of::<Odometry>(), MessageType::of::<Imu>());
        let base = [("a", odometry, &[1, 2][..], &[3][..]), ("b", odometry, &[4], &[])];
        let same = digest(&base).hex();
        assert_eq!(same, digest(&base).hex());
        let others = [
            digest(&[base[1], base[0]]),
            digest(&base[..1]),
            digest(&[("c", odometry, &[1, 2], &[3]), base[1]]),
            digest(&[("a", imu, &[1, 2], &[3]), base[1]]),
            digest(&[("a", odometry, &[1], &[2, 3]), base[1]]),
            digest(&[("a", odometry, &[1, 2], &[9]), base[1]]),
        ];
        for (i, other) in others.iter().enumerate() {
            assert_ne!(same, other.hex(), "case {i}");
        }
        assert_eq!(digest(&base).counts()["b"], 1);
    }
}
