//! Chunks of an MCAP file: found without its index, so that a recording whose writer was killed is read up to its end.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_mcap::{Channel as McapChannel, Messages, Opcode, ReadError, Record, Records};
use yamabico_runtime::record;

use super::RecordingError;

/// Contents of a channel.
#[derive(Clone, Debug)]
pub(crate) enum Contents {
    /// Messages of the bus, as JSON.
    Message(&'static MessageType),
    /// Pictures of the camera whose topic this is, as `foxglove.CompressedImage`.
    Pictures(Arc<str>),
}

/// A channel that is shown.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    pub topic: Arc<str>,
    pub contents: Contents,
}

/// A record of a channel that is shown.
#[derive(Clone, Debug)]
pub(crate) struct Entry<'a> {
    pub channel: Arc<Channel>,
    pub time: Time,
    /// Stamp on the clock of the run at time zero of the recording.
    pub origin: Time,
    pub data: Cow<'a, [u8]>,
}

impl Entry<'_> {
    /// The same record, to be kept.
    pub fn into_owned(self) -> Entry<'static> {
        Entry { data: Cow::Owned(self.data.into_owned()), ..self }
    }
}

/// Position and time of one chunk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunk {
    record: Record,
    /// Time of its last record.
    pub end: Time,
}

/// The chunks of a file in their order.
pub(crate) struct Chunks {
    path: PathBuf,
    messages: Messages,
    pub chunks: Vec<Chunk>,
    /// Stamp on the clock of the run at time zero of the recording: times here are those of the run, as stamps are.
    origin: Time,
    /// Attached texts by name.
    pub attachments: Vec<(String, String)>,
    /// Cause why the file ends early.
    pub broken_off: Option<String>,
    /// Channels by their numbers; `None` for one that is not shown.
    channels: BTreeMap<u16, Option<Arc<Channel>>>,
}

impl Chunks {
    /// Finds the chunks of the file.
    pub fn open(path: &Path) -> Result<Chunks, RecordingError> {
        let failed = |error| RecordingError::new(path, error);
        let contents = record::Contents::read(path).unwrap_or_default();
        let origin = contents.origin();
        let mut records = Records::open(path).map_err(failed)?;
        let (mut chunks, mut broken_off) = (Vec::new(), None);
        loop {
            match records.next() {
                Ok(Some(record)) if record.opcode == Opcode::CHUNK => {
                    // Its first and last time.
                    let [.., a, b, c, d, e, f, g, h] = records.beginning::<16>(&record).map_err(failed)?;
                    let end_ns = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
                    chunks.push(Chunk { record, end: Time(origin.0.saturating_add(end_ns)) });
                }
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(error) if chunks.is_empty() => return Err(failed(error)),
                Err(error) => {
                    broken_off = Some(error.to_string());
                    break;
                }
            }
        }
        if chunks.is_empty() {
            let reason = "it has no chunks".to_owned();
            return Err(RecordingError::NoRecording { path: path.to_owned(), reason });
        }
        let messages = Messages::of(records);
        let attachments = contents.files;
        let (path, channels) = (path.to_owned(), BTreeMap::new());
        Ok(Chunks { path, messages, chunks, origin, attachments, broken_off, channels })
    }

    /// Passes every record of the chunk at `index` to `each`, in the order of the file; none of a chunk whose checksum is wrong.
    pub fn read(&mut self, index: usize, each: &mut dyn FnMut(Entry<'_>)) -> Result<(), RecordingError> {
        let Some(Chunk { record, .. }) = self.chunks.get(index).copied() else { return Ok(()) };
        let (channels, origin) = (&mut self.channels, self.origin);
        let read = self.messages.of_chunk(&record, &mut |message| {
            let channel = message.channel;
            if let Some(channel) = channels.entry(channel.id).or_insert_with(|| shown(channel)) {
                let time = Time(origin.0.saturating_add(message.log_time));
                let channel = Arc::clone(channel);
                each(Entry { channel, time, origin, data: message.data.into() });
            }
        });
        match read {
            Err(error @ ReadError::Io(_)) => Err(RecordingError::new(&self.path, error)),
            Err(error) => {
                self.broken_off.get_or_insert(error.to_string());
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }
}

/// Channel as it is shown; `None` if it is not.
fn shown(channel: &McapChannel) -> Option<Arc<Channel>> {
    let schema = channel.schema.as_ref().map_or("", |schema| &schema.name);
    let camera = channel.topic.strip_suffix("/image").map(|topic| topic.trim_start_matches('/'));
    // Topics of the bus have no slash in front; others are made from them.
    let of_bus = MessageType::find(schema).filter(|_| !channel.topic.starts_with('/'));
    let contents = match (of_bus, camera) {
        (Some(message), _) => Contents::Message(message),
        (None, Some(camera)) if schema == "foxglove.CompressedImage" => Contents::Pictures(camera.into()),
        _ => return None,
    };
    Some(Arc::new(Channel { topic: channel.topic.as_str().into(), contents }))
}
