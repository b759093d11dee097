//! Compressed records.

use std::io::Read;

use crate::MAX_RECORD_BYTES;
use crate::error::ReadError;
use crate::fields::Fields;
use crate::records::Opcode;

/// Maximum length of the name of a compression in an error, bytes.
const MAX_NAME_BYTES: usize = 32;

/// Unpacks the body of the chunk at `at` into `records`, whole and with the right checksum.
///
/// # Errors
/// It is malformed, too long or damaged, or its compression is unknown.
pub(crate) fn unpack(body: &[u8], at: u64, records: &mut Vec<u8>) -> Result<(), ReadError> {
    records.clear();
    let opcode = Opcode::CHUNK;
    let malformed = || ReadError::Malformed { opcode, at };
    let Chunk { bytes, checksum, method, compressed } = Chunk::read(body).ok_or_else(malformed)?;
    let length = usize::try_from(bytes).ok().filter(|length| *length <= MAX_RECORD_BYTES);
    let length = length.ok_or(ReadError::TooLong { opcode, at, bytes })?;
    // Memory grows with what is there, not with what is claimed.
    let mut take = |source: &mut dyn Read| source.take(bytes).read_to_end(records).map_err(|_| malformed());
    match method {
        "" => take(&mut &*compressed)?,
        "lz4" => take(&mut lz4::Decoder::new(compressed)?)?,
        "zstd" => take(&mut zstd::Decoder::with_buffer(compressed)?)?,
        other => {
            let method: String = other.escape_default().take(MAX_NAME_BYTES).collect();
            return Err(ReadError::Compression { at, method });
        }
    };
    if records.len() != length {
        return Err(malformed());
    }
    // Zero is no checksum.
    match checksum == 0 || crc32fast::hash(records) == checksum {
        true => Ok(()),
        false => Err(ReadError::Checksum { at }),
    }
}

struct Chunk<'a> {
    /// Length of the records, bytes.
    bytes: u64,
    /// CRC-32 of the records.
    checksum: u32,
    method: &'a str,
    compressed: &'a [u8],
}

impl Chunk<'_> {
    fn read(body: &[u8]) -> Option<Chunk<'_>> {
        let mut fields = Fields(body);
        let _begin = fields.u64()?;
        let _end = fields.u64()?;
        let (bytes, checksum, method) = (fields.u64()?, fields.u32()?, fields.text()?);
        let length = usize::try_from(fields.u64()?).ok()?;
        Some(Chunk { bytes, checksum, method, compressed: fields.bytes(length)? })
    }
}
