//! Blocks of a file: chunks without their compression, and definitions and messages that stand by themselves.

use crate::chunk::unpack;
use crate::error::ReadError;
use crate::records::{Opcode, Record, Records};

/// A chunk without its compression, or the body of another record.
#[derive(Debug)]
pub(crate) struct Block {
    pub opcode: Opcode,
    /// Place in the file, bytes.
    pub at: u64,
    pub bytes: Vec<u8>,
}

impl Default for Block {
    fn default() -> Block {
        Block { opcode: Opcode::CHUNK, at: 0, bytes: Vec::new() }
    }
}

/// Reads the next block of a file to `block`; returns false at the end.
///
/// # Errors
/// The file cannot be read, is damaged, or ends early.
pub(crate) fn next_block(records: &mut Records, block: &mut Block) -> Result<bool, ReadError> {
    while let Some(record) = records.next()? {
        match record.opcode {
            Opcode::CHUNK => {
                read_chunk(records, &record, block)?;
                return Ok(true);
            }
            Opcode::SCHEMA | Opcode::CHANNEL | Opcode::MESSAGE => {
                (block.opcode, block.at) = (record.opcode, record.at);
                block.bytes.clear();
                block.bytes.extend_from_slice(records.body(&record)?);
                return Ok(true);
            }
            _ => {}
        }
    }
    Ok(false)
}

/// Reads a chunk to `block`.
///
/// # Errors
/// The file cannot be read, or the chunk is damaged.
pub(crate) fn read_chunk(records: &mut Records, chunk: &Record, block: &mut Block) -> Result<(), ReadError> {
    (block.opcode, block.at) = (chunk.opcode, chunk.at);
    unpack(records.body(chunk)?, chunk.at, &mut block.bytes)
}
