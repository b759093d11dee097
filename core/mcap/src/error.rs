//! Causes why a file cannot be read.

use crate::MAX_RECORD_BYTES;
use crate::records::Opcode;

/// Cause why a file, or the rest of it, cannot be read. Places are bytes from the beginning of the file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The system does not read the file.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file is of another kind.
    #[error("it does not begin as an MCAP file does")]
    Magic,
    /// The file ends within a record.
    #[error("it ends within the record at byte {at}, as after a kill or on a full disk")]
    CutOff {
        /// Place of the record.
        at: u64,
    },
    /// The file ends behind a record that is not the last one.
    #[error("it has no end, as after a kill")]
    NoEnd,
    /// A record is too long.
    #[error("the {opcode} at byte {at} has {bytes} bytes; at most {MAX_RECORD_BYTES} are read")]
    TooLong {
        /// Kind of the record.
        opcode: Opcode,
        /// Place of the record.
        at: u64,
        /// Its length, bytes.
        bytes: u64,
    },
    /// A record does not hold what records of its kind hold, such as a text that is longer than the record.
    #[error("the {opcode} at byte {at} is malformed")]
    Malformed {
        /// Kind of the record.
        opcode: Opcode,
        /// Place of the record, or of the chunk that it is in.
        at: u64,
    },
    /// A chunk has another checksum than it claims.
    #[error("the chunk at byte {at} is damaged: its checksum is wrong")]
    Checksum {
        /// Place of the chunk.
        at: u64,
    },
    /// A chunk is compressed in an unknown way.
    #[error("the chunk at byte {at} is compressed by `{method}`, and not by lz4 or zstd")]
    Compression {
        /// Place of the chunk.
        at: u64,
        /// Name of the method.
        method: String,
    },
    /// The definitions of channels and schemas are too long.
    #[error("its definitions of channels have more than {limit} bytes")]
    Definitions {
        /// Maximum length of all definitions, bytes.
        limit: usize,
    },
}
