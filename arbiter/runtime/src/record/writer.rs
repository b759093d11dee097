//! Writer thread: passes the records of a run to the channels of an MCAP file.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use foxglove::{Context, PartialMetadata, RawChannel};
use yamabico_core::time::Time;

use super::channels::{Format, Records};
use super::encoder::Encoder;
use super::queue::{Batch, Queue};
use super::run_file::RunFile;

/// Writes the messages of a queue to the channels of a context.
pub(super) struct Writer {
    encoder: Encoder,
    channels: Channels,
    counts: BTreeMap<String, u64>,
}

/// Channels of a context, which are opened by their first record.
struct Channels {
    context: Arc<Context>,
    open: HashMap<String, Arc<RawChannel>>,
}

impl Writer {
    pub fn new(context: Arc<Context>, encoder: Encoder) -> Writer {
        Writer { encoder, channels: Channels { context, open: HashMap::new() }, counts: BTreeMap::new() }
    }

    /// Writes everything from the queue to `file` until it ends or `has_failed` returns true; returns the number of messages
    /// written on each topic. Times count from the first message.
    pub fn run(
        mut self,
        queue: &Queue,
        file: &mut RunFile,
        has_failed: impl Fn() -> bool,
    ) -> BTreeMap<String, u64> {
        let mut batch = Batch::default();
        let mut has_begun = false;
        while queue.take(&mut batch) {
            for entry in batch.entries() {
                if !std::mem::replace(&mut has_begun, true) {
                    file.begin(entry.time);
                    self.encoder.begin(&mut self.channels, entry.time, Time::ZERO);
                }
                let bytes = (entry.header, entry.items);
                self.encoder.message(&mut self.channels, entry.topic, entry.message, entry.time, bytes);
                match self.counts.get_mut(&**entry.topic) {
                    Some(count) => *count += 1,
                    None => drop(self.counts.insert(entry.topic.to_string(), 1)),
                }
                if has_failed() {
                    return self.counts;
                }
            }
            file.save_if_due();
        }
        if !has_begun {
            file.begin(Time::ZERO);
        }
        self.counts
    }
}

impl Records for Channels {
    fn wants(&mut self, _: &str, _: Time) -> bool {
        true
    }

    fn take(&mut self, topic: &str, time: Time, format: &dyn Fn() -> Format, data: Vec<u8>) {
        if !self.open.contains_key(topic) {
            let Format { encoding, schema } = format();
            let channel = self.context.channel_builder(topic).message_encoding(encoding).schema(schema);
            let Ok(channel) = channel.build_raw() else { return };
            self.open.insert(topic.to_owned(), channel);
        }
        if let Some(channel) = self.open.get(topic) {
            channel.log_with_meta(&data, PartialMetadata::with_log_time(time.0));
        }
    }
}
