//! Records of a file, one behind the other. Bodies are read on request only, so that a file is looked through quickly.

use std::fmt;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::ReadError;
use crate::{MAGIC, MAX_RECORD_BYTES};

/// Size of the code and the length before each record, bytes.
const HEAD_BYTES: u64 = 9;

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opcode(pub u8);

impl Opcode {
    /// End of the file.
    pub const FOOTER: Opcode = Opcode(0x02);
    /// Type of messages.
    pub const SCHEMA: Opcode = Opcode(0x03);
    /// Stream of messages.
    pub const CHANNEL: Opcode = Opcode(0x04);
    /// Message.
    pub const MESSAGE: Opcode = Opcode(0x05);
    /// Messages and definitions, compressed.
    pub const CHUNK: Opcode = Opcode(0x06);
    /// Attached file.
    pub const ATTACHMENT: Opcode = Opcode(0x09);
    /// Facts.
    pub const METADATA: Opcode = Opcode(0x0c);
    /// End of the messages: an index follows.
    pub const DATA_END: Opcode = Opcode(0x0f);
}

impl fmt::Display for Opcode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match *self {
            Opcode::FOOTER => "footer",
            Opcode::SCHEMA => "schema",
            Opcode::CHANNEL => "channel",
            Opcode::MESSAGE => "message",
            Opcode::CHUNK => "chunk",
            Opcode::ATTACHMENT => "attachment",
            Opcode::METADATA => "record of facts",
            Opcode(other) => return write!(formatter, "record of kind {other}"),
        })
    }
}

/// Place of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Kind.
    pub opcode: Opcode,
    /// Place in the file, bytes.
    pub at: u64,
    /// Length of the body, bytes. The file has them.
    pub bytes: u64,
}

/// Records of a file. It ends after an error.
#[derive(Debug)]
pub struct Records {
    file: BufReader<File>,
    /// Place in the file.
    position: u64,
    /// Length of the file when it was opened.
    length: u64,
    /// Place of the next record; `None` at the end.
    next: Option<u64>,
    body: Vec<u8>,
}

impl Records {
    /// Opens the file.
    ///
    /// # Errors
    /// It cannot be read, or is no MCAP file.
    pub fn open(path: &Path) -> Result<Records, ReadError> {
        let file = File::open(path)?;
        let (length, mut file) = (file.metadata()?.len(), BufReader::new(file));
        let (mut magic, position) = (MAGIC, MAGIC.len() as u64);
        magic.fill(0);
        match file.read_exact(&mut magic) {
            Err(error) if error.kind() != ErrorKind::UnexpectedEof => return Err(error.into()),
            Ok(()) if magic == MAGIC => {}
            _ => return Err(ReadError::Magic),
        }
        Ok(Records { file, position, length, next: Some(position), body: Vec::new() })
    }

    /// Length of the file when it was opened, bytes.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Finds the next record; the footer is the last one. Returns `None` after it.
    ///
    /// # Errors
    /// The file cannot be read, or ends early.
    #[allow(clippy::should_implement_trait, reason = "an error ends it, and `?` is all that callers need")]
    pub fn next(&mut self) -> Result<Option<Record>, ReadError> {
        let Some(at) = self.next.take() else { return Ok(None) };
        let left = self.length.saturating_sub(at);
        if left < HEAD_BYTES {
            return Err(if left == 0 { ReadError::NoEnd } else { ReadError::CutOff { at } });
        }
        let [opcode, length @ ..] = self.read_at::<{ HEAD_BYTES as usize }>(at)?;
        let record = Record { opcode: Opcode(opcode), at, bytes: u64::from_le_bytes(length) };
        if opcode == 0 {
            return Err(ReadError::Malformed { opcode: record.opcode, at });
        }
        if record.bytes > left - HEAD_BYTES {
            return Err(ReadError::CutOff { at });
        }
        let end = at + HEAD_BYTES + record.bytes;
        if record.opcode != Opcode::FOOTER {
            self.next = Some(end);
        } else if self.length - end < MAGIC.len() as u64 || self.read_at(end)? != MAGIC {
            return Err(ReadError::NoEnd);
        }
        Ok(Some(record))
    }

    /// Reads the body of a record.
    ///
    /// # Errors
    /// The file cannot be read, or the record is longer than [`MAX_RECORD_BYTES`].
    pub fn body(&mut self, record: &Record) -> Result<&[u8], ReadError> {
        let Record { opcode, at, bytes } = *record;
        let length = usize::try_from(bytes).ok().filter(|bytes| *bytes <= MAX_RECORD_BYTES);
        let length = length.ok_or(ReadError::TooLong { opcode, at, bytes })?;
        self.go_to(at + HEAD_BYTES)?;
        self.body.resize(length, 0);
        self.read_exact_into_body(at)?;
        Ok(&self.body)
    }

    /// Reads the first bytes of the body of a record.
    ///
    /// # Errors
    /// The file cannot be read, or the record is shorter.
    pub fn beginning<const N: usize>(&mut self, record: &Record) -> Result<[u8; N], ReadError> {
        let Record { opcode, at, bytes } = *record;
        if bytes < N as u64 {
            return Err(ReadError::Malformed { opcode, at });
        }
        self.read_at(at + HEAD_BYTES)
    }

    fn read_exact_into_body(&mut self, at: u64) -> Result<(), ReadError> {
        // A failure leaves an unknown place.
        let position = std::mem::replace(&mut self.position, u64::MAX);
        self.file.read_exact(&mut self.body).map_err(|error| cut_off(error, at))?;
        self.position = position + self.body.len() as u64;
        Ok(())
    }

    fn read_at<const N: usize>(&mut self, at: u64) -> Result<[u8; N], ReadError> {
        self.go_to(at)?;
        let mut bytes = [0; N];
        let position = std::mem::replace(&mut self.position, u64::MAX);
        self.file.read_exact(&mut bytes).map_err(|error| cut_off(error, at))?;
        self.position = position + N as u64;
        Ok(bytes)
    }

    fn go_to(&mut self, at: u64) -> Result<(), ReadError> {
        match self.position {
            u64::MAX => drop(self.file.seek(SeekFrom::Start(at))?),
            // What is buffered stays.
            position => self.file.seek_relative(at as i64 - position as i64)?,
        }
        self.position = at;
        Ok(())
    }
}

/// Failure to read a file that has become shorter, or another one.
fn cut_off(error: std::io::Error, at: u64) -> ReadError {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => ReadError::CutOff { at },
        _ => ReadError::Io(error),
    }
}
