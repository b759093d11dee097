//! Messages of an MCAP file.
//!
//! The crate `mcap` takes chunks and records apart; the few records that count are read here, since its own parser reserves the
//! memory of a text by the length that a file claims.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};

use super::{StoredMessage, Topic};

/// Maximum length of one record, bytes; a longer one is refused before memory is reserved for it.
const MAX_RECORD_BYTES: usize = 128 << 20;
/// Maximum length of a name, bytes.
const MAX_NAME_BYTES: usize = 4096;

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES)
}

/// Messages of a file in the order in which they were written. It ends after an error.
pub struct McapMessages {
    source: BufReader<File>,
    reader: LinearReader,
    /// Names of the schemas by their numbers.
    schemas: BTreeMap<u16, String>,
    topics: BTreeMap<u16, Arc<Topic>>,
}

/// Returns the messages of a file.
///
/// # Errors
/// The file cannot be read.
pub fn messages(path: &Path) -> Result<McapMessages, String> {
    Ok(McapMessages {
        source: File::open(path).map(BufReader::new).map_err(|error| error.to_string())?,
        reader: LinearReader::new_with_options(options()),
        schemas: BTreeMap::new(),
        topics: BTreeMap::new(),
    })
}

impl Iterator for McapMessages {
    type Item = Result<StoredMessage, String>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let read = match self.reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(need)) => match self.source.read(self.reader.insert(need)) {
                    Ok(read) => {
                        self.reader.notify_read(read);
                        continue;
                    }
                    Err(error) => Err(error.to_string()),
                },
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    let read = match opcode {
                        op::SCHEMA => schema(data).map(|(id, name)| {
                            self.schemas.insert(id, name);
                            None
                        }),
                        op::CHANNEL => channel(data, &self.schemas).map(|(id, topic)| {
                            // A channel may come again, at the end of the file or in every chunk.
                            self.topics.entry(id).or_insert_with(|| Arc::new(topic));
                            None
                        }),
                        op::MESSAGE => message(data, &self.topics).map(Some),
                        _ => Some(None),
                    };
                    match read {
                        Some(None) => continue,
                        Some(Some(message)) => Ok(message),
                        None => Err(format!("a record of kind {opcode} is malformed")),
                    }
                }
                Err(error) => Err(error.to_string()),
            };
            return Some(read);
        }
    }
}

fn schema(data: &[u8]) -> Option<(u16, String)> {
    let mut fields = Fields(data);
    Some((fields.number::<2>()? as u16, fields.name()?))
}

fn channel(data: &[u8], schemas: &BTreeMap<u16, String>) -> Option<(u16, Topic)> {
    let mut fields = Fields(data);
    let id = fields.number::<2>()? as u16;
    // Zero is no schema.
    let schema = schemas.get(&(fields.number::<2>()? as u16));
    let (name, encoding) = (fields.name()?, fields.name()?);
    Some((id, Topic { name, message_type: schema.cloned().unwrap_or_default(), encoding }))
}

fn message(data: &[u8], topics: &BTreeMap<u16, Arc<Topic>>) -> Option<StoredMessage> {
    let mut fields = Fields(data);
    let topic = Arc::clone(topics.get(&(fields.number::<2>()? as u16))?);
    fields.number::<4>()?;
    let log_time = fields.number::<8>()?;
    fields.number::<8>()?;
    Some(StoredMessage { topic, log_time, data: fields.0.to_vec() })
}

/// Fields of a record, one behind the other, little endian.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<u64> {
        Some(self.take(N)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn name(&mut self) -> Option<String> {
        let bytes = self.number::<4>()? as usize;
        let text = self.take(bytes).filter(|_| bytes <= MAX_NAME_BYTES)?;
        std::str::from_utf8(text).ok().map(str::to_owned)
    }
}

/// Returns the stamp at time zero of a recording of this program, from its facts; zero for other files.
///
/// # Errors
/// The file cannot be read, or the fact is malformed.
pub fn origin(path: &Path) -> Result<u64, String> {
    let mut source = File::open(path).map(BufReader::new).map_err(|error| error.to_string())?;
    let mut reader = LinearReader::new_with_options(options().with_emit_chunks(true));
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| error.to_string())? {
            LinearReadEvent::ReadRequest(need) => {
                let read = source.read(reader.insert(need)).map_err(|error| error.to_string())?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: op::METADATA, data } => {
                if let Some(text) = fact(data, "origin_ns") {
                    return text.parse().map_err(|_| "the fact `origin_ns` is not a number".to_owned());
                }
            }
            LinearReadEvent::Record { opcode: op::CHUNK | op::MESSAGE, .. } => break,
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(0)
}

/// Value of a key in a metadata record: its name, then keys and values.
fn fact<'a>(data: &'a [u8], key: &str) -> Option<&'a str> {
    let mut fields = Fields(data);
    fields.name()?;
    let bytes = fields.number::<4>()? as usize;
    let mut facts = Fields(fields.take(bytes)?);
    while !facts.0.is_empty() {
        let mut text = || {
            let bytes = facts.number::<4>()? as usize;
            std::str::from_utf8(facts.take(bytes)?).ok()
        };
        let (name, value) = (text()?, text()?);
        if name == key {
            return Some(value);
        }
    }
    None
}
