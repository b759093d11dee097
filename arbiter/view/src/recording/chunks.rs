//! Chunks of an MCAP file: found without its index, so that a recording whose writer was killed is read up to its end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::record;

use super::RecordingError;

/// Maximum size of a chunk, attachment or definition, bytes.
const MAX_RECORD_BYTES: u64 = 256 << 20;
/// Size of the code and the length before each record.
const HEAD_BYTES: usize = 9;

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
pub(crate) struct Entry {
    pub channel: Arc<Channel>,
    pub time: Time,
    /// Stamp on the clock of the run at time zero of the recording.
    pub origin: Time,
    pub data: Vec<u8>,
}

/// Position and time of one chunk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunk {
    offset: u64,
    size: u64,
    /// Time of its last record.
    pub end: Time,
}

/// The chunks of a file in their order.
pub(crate) struct Chunks {
    path: PathBuf,
    file: BufReader<File>,
    pub chunks: Vec<Chunk>,
    /// Stamp on the clock of the run at time zero of the recording: times here are those of the run, as stamps are.
    origin: Time,
    /// Attached texts by name.
    pub attachments: Vec<(String, String)>,
    /// Cause why the file ends early.
    pub broken_off: Option<String>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<Channel>>,
}

impl Chunks {
    /// Finds the chunks of the file.
    pub fn open(path: &Path) -> Result<Chunks, RecordingError> {
        let unreadable = |source| RecordingError::NotReadable { path: path.to_owned(), source };
        let file = BufReader::new(File::open(path).map_err(unreadable)?);
        let mut chunks = Chunks {
            path: path.to_owned(),
            file,
            chunks: Vec::new(),
            origin: record::Contents::read(path).map_or(Time::ZERO, |contents| contents.origin()),
            attachments: Vec::new(),
            broken_off: None,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        };
        let mut magic = [0; mcap::MAGIC.len()];
        if chunks.file.read_exact(&mut magic).is_err() || magic != *mcap::MAGIC {
            return Err(chunks.no_recording("it is not an MCAP file"));
        }
        chunks.scan().map_err(unreadable)?;
        if chunks.chunks.is_empty() {
            let reason = chunks.broken_off.clone().unwrap_or("it has no chunks".to_owned());
            return Err(chunks.no_recording(&reason));
        }
        Ok(chunks)
    }

    /// Time of the recording on the clock of the run.
    fn on_run(&self, log_time_ns: u64) -> Time {
        Time(self.origin.0.saturating_add(log_time_ns))
    }

    pub fn no_recording(&self, reason: &str) -> RecordingError {
        RecordingError::NoRecording { path: self.path.clone(), reason: reason.to_owned() }
    }

    fn scan(&mut self) -> std::io::Result<()> {
        let length = self.file.get_ref().metadata()?.len();
        let mut offset = mcap::MAGIC.len() as u64;
        loop {
            let mut head = [0; HEAD_BYTES];
            self.file.seek(SeekFrom::Start(offset))?;
            if self.file.read_exact(&mut head).is_err() {
                self.broken_off =
                    Some("its end is missing: its writer was killed, or the disk was full".to_owned());
                return Ok(());
            }
            let [code, size @ ..] = head;
            let size = u64::from_le_bytes(size);
            let begin = offset + HEAD_BYTES as u64;
            if size > length.saturating_sub(begin) {
                self.broken_off = Some(
                    "its last part is incomplete: its writer was killed, or the disk was full".to_owned(),
                );
                return Ok(());
            }
            match code {
                op::DATA_END | op::FOOTER => return Ok(()),
                op::CHUNK => {
                    let mut times = [0; 16];
                    self.file.read_exact(&mut times)?;
                    let [.., a, b, c, d, e, f, g, h] = times;
                    let end = self.on_run(u64::from_le_bytes([a, b, c, d, e, f, g, h]));
                    self.chunks.push(Chunk { offset: begin, size, end });
                }
                op::ATTACHMENT | op::SCHEMA | op::CHANNEL if size <= MAX_RECORD_BYTES => {
                    let mut body = vec![0; size as usize];
                    self.file.read_exact(&mut body)?;
                    match code {
                        op::ATTACHMENT => self.attachments.extend(attachment(&body)),
                        _ => drop(parse_record(code, &body).map(|record| self.define(&record))),
                    }
                }
                _ => {}
            }
            offset = begin + size;
        }
    }

    /// Passes every record of the chunk at `index` to `each`, in the order of the file.
    pub fn read(&mut self, index: usize, each: &mut dyn FnMut(Entry)) -> Result<(), RecordingError> {
        let Some(Chunk { offset, size, .. }) = self.chunks.get(index).copied() else { return Ok(()) };
        if size > MAX_RECORD_BYTES {
            return Err(self.no_recording("it has a chunk of more than 256 MiB"));
        }
        let unreadable = |source| RecordingError::NotReadable { path: self.path.clone(), source };
        // The whole record, with its code and length.
        self.file.seek(SeekFrom::Start(offset - HEAD_BYTES as u64)).map_err(unreadable)?;
        let mut record = vec![0; size as usize + HEAD_BYTES];
        self.file.read_exact(&mut record).map_err(unreadable)?;
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_record_length_limit(MAX_RECORD_BYTES as usize);
        let (mut reader, mut rest) = (LinearReader::new_with_options(options), &record[..]);
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let (now, later) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    rest = later;
                }
                Ok(LinearReadEvent::Record { data, opcode }) => self.record(opcode, data, each),
                Err(error) => {
                    self.broken_off.get_or_insert(error.to_string());
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Takes in one record of a chunk.
    fn record(&mut self, code: u8, body: &[u8], each: &mut dyn FnMut(Entry)) {
        match parse_record(code, body) {
            Ok(Record::Message { header, data }) => {
                if let Some(channel) = self.channels.get(&header.channel_id) {
                    let channel = Arc::clone(channel);
                    let time = self.on_run(header.log_time);
                    each(Entry { channel, time, origin: self.origin, data: data.into_owned() });
                }
            }
            Ok(record) => self.define(&record),
            Err(_) => {}
        }
    }

    /// Takes in a definition.
    fn define(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema { header, .. } => drop(self.schemas.insert(header.id, header.name.clone())),
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
                let camera = channel.topic.strip_suffix("/image").map(|topic| topic.trim_start_matches('/'));
                // Topics of the bus have no slash in front; others are made from them.
                let of_bus = MessageType::find(schema).filter(|_| !channel.topic.starts_with('/'));
                let contents = match (of_bus, camera) {
                    (Some(message), _) => Contents::Message(message),
                    (None, Some(camera)) if schema == "foxglove.CompressedImage" => {
                        Contents::Pictures(camera.into())
                    }
                    _ => return,
                };
                let topic = channel.topic.as_str().into();
                self.channels.insert(channel.id, Arc::new(Channel { topic, contents }));
            }
            _ => {}
        }
    }
}

/// Name and text of an attachment; `None` if it is incomplete or no text.
fn attachment(body: &[u8]) -> Option<(String, String)> {
    // Two times, then name, media type and data, each behind its length.
    let (name, rest) = counted::<4>(body.get(16..)?)?;
    let (_, rest) = counted::<4>(rest)?;
    let (data, _) = counted::<8>(rest)?;
    let text = |bytes: &[u8]| std::str::from_utf8(bytes).ok().map(str::to_owned);
    Some((text(name)?, text(data)?))
}

/// Splits off bytes behind their number, an integer of `N` bytes.
fn counted<const N: usize>(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_at_checked(N)?;
    let count = count.iter().rev().fold(0_u64, |count, byte| count << 8 | u64::from(*byte));
    rest.split_at_checked(usize::try_from(count).ok()?)
}
