//! Messages of an MCAP file.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use yamabico_mcap::{Channel, Messages, Metadata, Opcode, Records};

use super::{StoredMessage, Topic};

/// Messages of a file in the order in which they were written. It ends after an error.
pub struct McapMessages {
    messages: Messages,
    topics: BTreeMap<u16, Arc<Topic>>,
}

/// Returns the messages of a file.
///
/// # Errors
/// The file cannot be read.
pub fn messages(path: &Path) -> Result<McapMessages, String> {
    let messages = Messages::open(path).map_err(|error| error.to_string())?;
    Ok(McapMessages { messages, topics: BTreeMap::new() })
}

impl Iterator for McapMessages {
    type Item = Result<StoredMessage, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let message = match self.messages.next() {
            Ok(message) => message?,
            Err(error) => return Some(Err(error.to_string())),
        };
        let topic = self.topics.entry(message.channel.id).or_insert_with(|| topic(message.channel));
        let (log_time, data) = (message.log_time, message.data.to_vec());
        Some(Ok(StoredMessage { topic: Arc::clone(topic), log_time, data }))
    }
}

fn topic(channel: &Channel) -> Arc<Topic> {
    let message_type = channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
    Arc::new(Topic { name: channel.topic.clone(), message_type, encoding: channel.encoding.clone() })
}

/// Returns the stamp at time zero of a recording of this program, from its facts; zero for other files.
///
/// # Errors
/// The file cannot be read, or the fact is malformed.
pub fn origin(path: &Path) -> Result<u64, String> {
    let failed = |error: yamabico_mcap::ReadError| error.to_string();
    let mut records = Records::open(path).map_err(failed)?;
    while let Some(record) = records.next().map_err(failed)? {
        match record.opcode {
            Opcode::METADATA => {
                let facts = Metadata::read(records.body(&record).map_err(failed)?).unwrap_or_default().facts;
                if let Some(text) = facts.get("origin_ns") {
                    return text.parse().map_err(|_| "the fact `origin_ns` is not a number".to_owned());
                }
            }
            Opcode::CHUNK | Opcode::MESSAGE => break,
            _ => {}
        }
    }
    Ok(0)
}
