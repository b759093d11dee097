//! Channels of a file and the schemas of their messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::error::ReadError;
use crate::fields::Fields;
use crate::records::Opcode;

/// Maximum length of all definitions, bytes.
const MAX_BYTES: usize = 64 << 20;

/// Type of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Name, such as `sensor_msgs/msg/LaserScan`.
    pub name: String,
    /// Language of the definition, such as `jsonschema`.
    pub encoding: String,
    /// Definition.
    pub data: Vec<u8>,
}

/// Stream of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Number in the file.
    pub id: u16,
    /// Topic.
    pub topic: String,
    /// Encoding of the messages, such as `json` or `cdr`.
    pub encoding: String,
    /// Type of the messages; `None` if the file does not name it.
    pub schema: Option<Arc<Schema>>,
    /// Facts.
    pub metadata: BTreeMap<String, String>,
}

/// Definitions that have been read.
#[derive(Debug, Default)]
pub(crate) struct Definitions {
    schemas: BTreeMap<u16, Arc<Schema>>,
    channels: BTreeMap<u16, Arc<Channel>>,
    bytes: usize,
}

impl Definitions {
    /// Channel by its number.
    pub fn channel(&self, id: u16) -> Option<&Arc<Channel>> {
        self.channels.get(&id)
    }

    /// Takes in the body of a schema or channel. It may come again, at the end of the file or in every chunk, but not with another
    /// contents.
    ///
    /// # Errors
    /// It is malformed, contradicts an earlier one, or there are too many.
    pub fn add(&mut self, opcode: Opcode, body: &[u8], at: u64) -> Result<(), ReadError> {
        let is_new = match opcode {
            Opcode::SCHEMA => self.add_schema(body),
            _ => self.add_channel(body),
        };
        if is_new.ok_or(ReadError::Malformed { opcode, at })? {
            self.bytes += body.len() + size_of::<Channel>();
        }
        if self.bytes > MAX_BYTES { Err(ReadError::Definitions { limit: MAX_BYTES }) } else { Ok(()) }
    }

    fn add_schema(&mut self, body: &[u8]) -> Option<bool> {
        let mut fields = Fields(body);
        let id = fields.u16()?;
        let (name, encoding, data) = (fields.text()?, fields.text()?, fields.counted()?);
        if let Some(known) = self.schemas.get(&id) {
            let is_same = (&*known.name, &*known.encoding, &*known.data) == (name, encoding, data);
            return is_same.then_some(false);
        }
        let schema = Schema { name: name.to_owned(), encoding: encoding.to_owned(), data: data.to_vec() };
        self.schemas.insert(id, Arc::new(schema));
        Some(true)
    }

    fn add_channel(&mut self, body: &[u8]) -> Option<bool> {
        let mut fields = Fields(body);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        // Zero is no schema.
        let schema = self.schemas.get(&schema).cloned();
        let (topic, encoding) = (fields.text()?, fields.text()?);
        if let Some(known) = self.channels.get(&id) {
            let is_same = (&*known.topic, &*known.encoding, &known.schema) == (topic, encoding, &schema);
            return is_same.then_some(false);
        }
        let (topic, encoding) = (topic.to_owned(), encoding.to_owned());
        let channel = Channel { id, topic, encoding, schema, metadata: fields.pairs()? };
        self.channels.insert(id, Arc::new(channel));
        Some(true)
    }
}
