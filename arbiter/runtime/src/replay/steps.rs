//! Messages of a recording, one step after the other, read on a thread of their own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use yamabico_core::message::{MessageType, RawMessage};
use yamabico_core::time::Time;

use crate::record::{PlaybackError, PlaybackResult, Tap, play, play_headers, play_topics};

/// Batches of steps by which the reader is ahead.
const AHEAD: usize = 8;
/// Size from which on a batch is complete, bytes: waking a thread for every step would take longer than the step.
const BATCH_BYTES: usize = 64 << 10;

/// A recorded message.
#[derive(Clone, Debug)]
pub(super) struct RecordedMessage {
    pub topic: String,
    pub message: MessageType,
    pub header: Vec<u8>,
    pub items: Vec<u8>,
}

/// Header and items of a message. A list without items is aligned as well, which an empty vector of bytes is not.
pub(super) fn raw(message: &RecordedMessage) -> RawMessage<'_> {
    const NO_ITEMS: &[u64] = &[];
    let items = if message.items.is_empty() { bytemuck::cast_slice(NO_ITEMS) } else { &message.items };
    RawMessage { header: &message.header, items }
}

/// Messages with the same time, in the order of the recording.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub time: Time,
    pub messages: Vec<RecordedMessage>,
}

/// Steps of a recording.
pub(super) struct Steps {
    batches: Option<Receiver<Vec<Step>>>,
    batch: std::vec::IntoIter<Step>,
    reader: Option<JoinHandle<Result<PlaybackResult, PlaybackError>>>,
}

impl Steps {
    /// Begins to read the recording `path`.
    pub fn read(path: &Path) -> Steps {
        Steps::read_from(path, play)
    }

    /// Begins to read these topics of the recording `path`, without pixels.
    pub fn read_headers(path: &Path, topics: BTreeSet<String>) -> Steps {
        Steps::read_from(path, move |path, tap| play_headers(path, tap, &|topic| topics.contains(topic)))
    }

    /// Begins to read these topics of the recording `path`.
    pub fn read_topics(path: &Path, topics: BTreeSet<String>) -> Steps {
        Steps::read_from(path, move |path, tap| play_topics(path, tap, &|topic| topics.contains(topic)))
    }

    fn read_from(
        path: &Path,
        play: impl FnOnce(&Path, &mut dyn Tap) -> Result<PlaybackResult, PlaybackError> + Send + 'static,
    ) -> Steps {
        let (sender, batches) = sync_channel(AHEAD);
        let path: PathBuf = path.to_owned();
        let reader = std::thread::spawn(move || {
            let mut grouper = Grouper { sender, batch: Vec::new(), bytes: 0, step: None, is_wanted: true };
            let played = play(&path, &mut grouper)?;
            // The last step of a recording that breaks off is incomplete.
            if played.broken_off.is_none() {
                grouper.end_step();
            }
            grouper.send();
            Ok(played)
        });
        Steps { batches: Some(batches), batch: Vec::new().into_iter(), reader: Some(reader) }
    }

    /// Result of the reading, after the last step.
    ///
    /// # Errors
    /// The file is no recording.
    pub fn finish(mut self) -> Result<PlaybackResult, PlaybackError> {
        self.batches = None;
        match self.reader.take().map(JoinHandle::join) {
            Some(Ok(read)) => read,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(PlaybackResult::default()),
        }
    }
}

impl Iterator for Steps {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        loop {
            if let Some(step) = self.batch.next() {
                return Some(step);
            }
            self.batch = self.batches.as_ref()?.recv().ok()?.into_iter();
        }
    }
}

/// Groups messages by their time.
struct Grouper {
    sender: SyncSender<Vec<Step>>,
    /// Complete steps, and their size.
    batch: Vec<Step>,
    bytes: usize,
    step: Option<Step>,
    is_wanted: bool,
}

impl Grouper {
    fn end_step(&mut self) {
        self.batch.extend(self.step.take());
    }

    fn send(&mut self) {
        self.bytes = 0;
        self.is_wanted &= self.sender.send(std::mem::take(&mut self.batch)).is_ok();
    }
}

impl Tap for Grouper {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if !self.is_wanted {
            return;
        }
        if self.step.as_ref().is_some_and(|step| step.time != time) {
            self.end_step();
            if self.bytes >= BATCH_BYTES {
                self.send();
            }
        }
        self.bytes += size_of::<RecordedMessage>() + header.len() + items.len();
        let step = self.step.get_or_insert_with(|| Step { time, messages: Vec::new() });
        step.messages.push(RecordedMessage {
            topic: topic.to_owned(),
            message: *message,
            header: header.to_vec(),
            items: items.to_vec(),
        });
    }
}
