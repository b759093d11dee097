//! Messages of a file, in the order in which they were written.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use crate::chunk::unpack;
use crate::definitions::{Channel, Definitions};
use crate::error::ReadError;
use crate::fields::Fields;
use crate::records::{Opcode, Record, Records};

/// A message.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Its channel.
    pub channel: &'a Arc<Channel>,
    /// Number, from the publisher.
    pub sequence: u32,
    /// Time at which it was recorded, ns.
    pub log_time: u64,
    /// Time at which it was published, ns.
    pub publish_time: u64,
    /// Encoded message.
    pub data: &'a [u8],
}

/// Messages of a file. Memory is bounded by the longest chunk and by the definitions.
#[derive(Debug)]
pub struct Messages {
    records: Records,
    definitions: Definitions,
    /// Records of the current chunk, and its place in the file.
    chunk: Vec<u8>,
    chunk_at: u64,
    /// Part of the chunk that has been read, bytes.
    read: usize,
    is_over: bool,
}

impl Messages {
    /// Opens the file.
    ///
    /// # Errors
    /// It cannot be read, or is no MCAP file.
    pub fn open(path: &Path) -> Result<Messages, ReadError> {
        Ok(Messages::of(Records::open(path)?))
    }

    /// Messages of the records that have not been read yet.
    #[must_use]
    pub fn of(records: Records) -> Messages {
        Messages {
            records,
            definitions: Definitions::default(),
            chunk: Vec::new(),
            chunk_at: 0,
            read: 0,
            is_over: false,
        }
    }

    /// Returns the next message; `None` at the end of the file, and after an error.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or ends early: the messages so far are whole.
    #[allow(clippy::should_implement_trait, reason = "a message lives until the next one only")]
    pub fn next(&mut self) -> Result<Option<Message<'_>>, ReadError> {
        if self.is_over {
            return Ok(None);
        }
        self.is_over = true;
        let body = loop {
            if let Some(body) = self.next_in_chunk()? {
                break body;
            }
            let Some(record) = self.records.next()? else { return Ok(None) };
            match record.opcode {
                Opcode::CHUNK => self.load(&record)?,
                Opcode::SCHEMA | Opcode::CHANNEL => {
                    let body = self.records.body(&record)?;
                    self.definitions.add(record.opcode, body, record.at)?;
                }
                Opcode::MESSAGE => {
                    self.chunk.clear();
                    (self.chunk_at, self.read) = (record.at, 0);
                    self.chunk.extend_from_slice(self.records.body(&record)?);
                    self.read = self.chunk.len();
                    break 0..self.read;
                }
                _ => {}
            }
        };
        self.is_over = self.message(body.clone()).is_err();
        self.message(body).map(Some)
    }

    /// Passes the messages of one chunk to `each`. Their channels are defined in it, or in what was read before.
    ///
    /// # Errors
    /// The file cannot be read, or the chunk is damaged.
    pub fn of_chunk(&mut self, chunk: &Record, each: &mut dyn FnMut(&Message<'_>)) -> Result<(), ReadError> {
        self.load(chunk)?;
        while let Some(body) = self.next_in_chunk()? {
            each(&self.message(body)?);
        }
        Ok(())
    }

    fn load(&mut self, chunk: &Record) -> Result<(), ReadError> {
        (self.chunk_at, self.read) = (chunk.at, 0);
        unpack(self.records.body(chunk)?, chunk.at, &mut self.chunk)
    }

    /// Finds the body of the next message in the chunk, and takes in the definitions before it.
    fn next_in_chunk(&mut self) -> Result<Option<Range<usize>>, ReadError> {
        let at = self.chunk_at;
        while let Some(rest) = self.chunk.get(self.read..).filter(|rest| !rest.is_empty()) {
            let malformed = ReadError::Malformed { opcode: Opcode::CHUNK, at };
            let [opcode, l0, l1, l2, l3, l4, l5, l6, l7, rest @ ..] = rest else { return Err(malformed) };
            let length = u64::from_le_bytes([*l0, *l1, *l2, *l3, *l4, *l5, *l6, *l7]);
            let body = usize::try_from(length).ok().and_then(|length| rest.get(..length));
            let Some(body) = body else { return Err(malformed) };
            let begin = self.chunk.len() - rest.len();
            self.read = begin + body.len();
            match Opcode(*opcode) {
                Opcode::MESSAGE => return Ok(Some(begin..self.read)),
                opcode @ (Opcode::SCHEMA | Opcode::CHANNEL) => self.definitions.add(opcode, body, at)?,
                _ => {}
            }
        }
        Ok(None)
    }

    fn message(&self, body: Range<usize>) -> Result<Message<'_>, ReadError> {
        let read = || {
            let mut fields = Fields(self.chunk.get(body)?);
            Some(Message {
                channel: self.definitions.channel(fields.u16()?)?,
                sequence: fields.u32()?,
                log_time: fields.u64()?,
                publish_time: fields.u64()?,
                data: fields.0,
            })
        };
        read().ok_or(ReadError::Malformed { opcode: Opcode::MESSAGE, at: self.chunk_at })
    }
}
