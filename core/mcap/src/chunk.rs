//! Compressed records.

use std::io::Read;

use crate::MAX_RECORD_BYTES;
use crate::error::ReadError;
use crate::fields::Fields;
use crate::records::Opcode;

/// Maximum length of the name of a compression in an error, bytes.
const MAX_NAME_BYTES: usize = 32;

/// Size of the head of a frame of LZ4 with nothing optional in it: a magic number, flags, block size and a checksum, bytes.
const FRAME_HEAD: usize = 7;
/// Flag of a frame of LZ4 that ends with a checksum of its contents.
const CONTENT_CHECKSUM: u8 = 1 << 2;
/// Flags of a frame of LZ4 with something optional in its head: the size of its contents, or a dictionary.
const OPTIONAL: u8 = 1 << 3 | 1;
/// Step in which memory grows, bytes: with what is there, not with what is claimed.
const STEP_BYTES: usize = 4 << 20;

/// Unpacks the body of the chunk at `at` into `records`, whole and with the right checksum; their memory is reused.
///
/// # Errors
/// It is malformed, too long or damaged, or its compression is unknown.
pub(crate) fn unpack(body: &[u8], at: u64, records: &mut Vec<u8>) -> Result<(), ReadError> {
    let opcode = Opcode::CHUNK;
    let malformed = || ReadError::Malformed { opcode, at };
    let Chunk { bytes, checksum, method, compressed } = Chunk::read(body).ok_or_else(malformed)?;
    let length = usize::try_from(bytes).ok().filter(|length| *length <= MAX_RECORD_BYTES);
    let length = length.ok_or(ReadError::TooLong { opcode, at, bytes })?;
    let mut take = |source: &mut dyn Read| fill(records, length, source).map_err(|_| malformed());
    match method {
        "" => take(&mut &*compressed)?,
        "lz4" => {
            // One checksum is enough, and that of the chunk is the faster one.
            let (head, rest) = compressed.split_at_checked(FRAME_HEAD).ok_or_else(malformed)?;
            let unchecked = unchecked_head(head).filter(|_| checksum != 0);
            take(&mut lz4::Decoder::new(unchecked.as_ref().map_or(head, |head| head).chain(rest))?)?;
        }
        "zstd" => take(&mut zstd::Decoder::with_buffer(compressed)?)?,
        other => {
            let method: String = other.escape_default().take(MAX_NAME_BYTES).collect();
            return Err(ReadError::Compression { at, method });
        }
    }
    // Zero is no checksum.
    match checksum == 0 || crc32fast::hash(records) == checksum {
        true => Ok(()),
        false => Err(ReadError::Checksum { at }),
    }
}

/// Fills `records` with this number of bytes.
fn fill(records: &mut Vec<u8>, length: usize, source: &mut dyn Read) -> std::io::Result<()> {
    let mut filled = 0;
    while filled < length {
        let end = length.min(filled + STEP_BYTES);
        records.resize(records.len().max(end), 0);
        source.read_exact(&mut records[filled..end])?;
        filled = end;
    }
    records.truncate(length);
    Ok(())
}

/// Head of a frame of LZ4 without the flag that its contents have a checksum; `None` if it has none, or an optional part.
fn unchecked_head(head: &[u8]) -> Option<[u8; FRAME_HEAD]> {
    let &[m0, m1, m2, m3, flags, block_size, _] = head else { return None };
    if flags & CONTENT_CHECKSUM == 0 || flags & OPTIONAL != 0 {
        return None;
    }
    let flags = flags & !CONTENT_CHECKSUM;
    let checksum = (xxh32(&[flags, block_size]) >> 8) as u8;
    Some([m0, m1, m2, m3, flags, block_size, checksum])
}

/// Hash XXH32 of fewer than four bytes with the seed 0 (Collet, xxHash specification 0.1.1).
fn xxh32(bytes: &[u8]) -> u32 {
    const PRIMES: [u32; 4] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d, 0x1656_67b1];
    let mut hash = PRIMES[3].wrapping_add(bytes.len() as u32);
    for byte in bytes {
        let more = u32::from(*byte).wrapping_mul(PRIMES[3]);
        hash = hash.wrapping_add(more).rotate_left(11).wrapping_mul(PRIMES[0]);
    }
    hash = (hash ^ (hash >> 15)).wrapping_mul(PRIMES[1]);
    hash = (hash ^ (hash >> 13)).wrapping_mul(PRIMES[2]);
    hash ^ (hash >> 16)
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
