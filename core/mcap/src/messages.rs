//! Messages of a file, in the order in which they were written.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use crate::blocks::{Block, next_block, read_chunk};
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
    unpacked: Unpacked,
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
        Messages { records, unpacked: Unpacked::default(), is_over: false }
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
            if let Some(body) = self.unpacked.next()? {
                break body;
            }
            if !next_block(&mut self.records, self.unpacked.renew())? {
                return Ok(None);
            }
        };
        self.is_over = self.unpacked.message(body.clone()).is_err();
        self.unpacked.message(body).map(Some)
    }

    /// Passes the messages of one chunk to `each`. Their channels are defined in it, or in what was read before.
    ///
    /// # Errors
    /// The file cannot be read, or the chunk is damaged.
    pub fn of_chunk(&mut self, chunk: &Record, each: &mut dyn FnMut(&Message<'_>)) -> Result<(), ReadError> {
        read_chunk(&mut self.records, chunk, self.unpacked.renew())?;
        while let Some(body) = self.unpacked.next()? {
            each(&self.unpacked.message(body)?);
        }
        Ok(())
    }
}

/// A block whose messages are read, and the definitions so far.
#[derive(Debug, Default)]
pub(crate) struct Unpacked {
    definitions: Definitions,
    block: Block,
    /// Part of the block that has been read, bytes; `None` if the block is over.
    read: Option<usize>,
}

impl Unpacked {
    /// The block, to be filled with the next one.
    pub fn renew(&mut self) -> &mut Block {
        self.read = Some(0);
        &mut self.block
    }

    /// Finds the body of the next message in the block, and takes in the definitions before it.
    ///
    /// # Errors
    /// The block is malformed.
    pub fn next(&mut self) -> Result<Option<Range<usize>>, ReadError> {
        let Some(read) = self.read.take() else { return Ok(None) };
        let Block { opcode, at, bytes } = &self.block;
        if *opcode == Opcode::MESSAGE {
            return Ok(Some(0..bytes.len()));
        }
        if *opcode != Opcode::CHUNK {
            self.definitions.add(*opcode, bytes, *at)?;
            return Ok(None);
        }
        let mut rest = bytes.get(read..).unwrap_or_default();
        while !rest.is_empty() {
            let malformed = ReadError::Malformed { opcode: Opcode::CHUNK, at: *at };
            let [opcode, l0, l1, l2, l3, l4, l5, l6, l7, behind @ ..] = rest else { return Err(malformed) };
            let length = u64::from_le_bytes([*l0, *l1, *l2, *l3, *l4, *l5, *l6, *l7]);
            let body = usize::try_from(length).ok().and_then(|length| behind.get(..length));
            let Some(body) = body else { return Err(malformed) };
            let begin = bytes.len() - behind.len();
            let end = begin + body.len();
            rest = &bytes[end..];
            match Opcode(*opcode) {
                Opcode::MESSAGE => {
                    self.read = Some(end);
                    return Ok(Some(begin..end));
                }
                opcode @ (Opcode::SCHEMA | Opcode::CHANNEL) => self.definitions.add(opcode, body, *at)?,
                _ => {}
            }
        }
        Ok(None)
    }

    /// Message with this body.
    ///
    /// # Errors
    /// It is malformed, or its channel is not defined.
    pub fn message(&self, body: Range<usize>) -> Result<Message<'_>, ReadError> {
        let read = || {
            let mut fields = Fields(self.block.bytes.get(body)?);
            Some(Message {
                channel: self.definitions.channel(fields.u16()?)?,
                sequence: fields.u32()?,
                log_time: fields.u64()?,
                publish_time: fields.u64()?,
                data: fields.0,
            })
        };
        read().ok_or(ReadError::Malformed { opcode: Opcode::MESSAGE, at: self.block.at })
    }
}
