//! Messages of an MCAP file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use mcap::io::MessageReader;
use mcap::records::{Record, op};
use mcap::sans_io::LinearReaderOptions;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};

use super::{StoredMessage, Topic};

/// Maximum length of one record, bytes; a longer one is refused before memory is reserved for it.
const MAX_RECORD_BYTES: usize = 128 << 20;

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES)
}

/// Returns the messages of a file in the order in which they were written.
///
/// # Errors
/// The file cannot be read.
pub fn messages(
    path: &Path,
) -> Result<impl Iterator<Item = Result<StoredMessage, String>> + Send + use<>, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut topics: BTreeMap<u16, Arc<Topic>> = BTreeMap::new();
    let messages = MessageReader::new_with_options(BufReader::new(file), options());
    Ok(messages.map(move |message| {
        let message = message.map_err(|error| error.to_string())?;
        let channel = &message.channel;
        let topic = topics.entry(channel.id).or_insert_with(|| {
            Arc::new(Topic {
                name: channel.topic.clone(),
                message_type: channel.schema.as_ref().map_or("", |schema| &schema.name).to_owned(),
                encoding: channel.message_encoding.clone(),
            })
        });
        Ok(StoredMessage { topic: Arc::clone(topic), log_time: message.log_time, data: message.data.into() })
    }))
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
                if let Ok(Record::Metadata(record)) = mcap::parse_record(op::METADATA, data)
                    && let Some(text) = record.metadata.get("origin_ns")
                {
                    return text.parse().map_err(|_| "the fact `origin_ns` is not a number".to_owned());
                }
            }
            LinearReadEvent::Record { opcode: op::CHUNK | op::MESSAGE, .. } => break,
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(0)
}
