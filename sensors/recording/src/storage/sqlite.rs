//! Reads the tables of an SQLite 3 file, row by row in the order of their numbers.
//!
//! The file format is documented by SQLite ("Database File Format"). Only what a rosbag2 recording needs is read: tables with
//! row numbers, UTF-8, no index. Every length is checked against the file, so a file that lies costs bounded time and memory.

use std::borrow::Borrow;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Maximum size of a row, bytes.
const MAX_ROW_BYTES: usize = 128 << 20;
/// Maximum height of a tree of pages; each level holds at least two pages.
const MAX_DEPTH: usize = 32;
/// Size of the header of the file, bytes.
const HEADER_BYTES: usize = 100;

/// Types of pages.
const INTERIOR: u8 = 5;
const LEAF: u8 = 13;

/// An open file.
#[derive(Debug)]
pub struct Database {
    file: File,
    page_bytes: usize,
    /// Size of a page without its reserved end, bytes.
    usable: usize,
    pages: u32,
}

/// A table: its first page, and the names of its columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    root: u32,
    /// Names of the columns in their order.
    pub columns: Vec<String>,
}

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Nothing; also the column that is the number of the row.
    Null,
    /// Integer.
    Integer(i64),
    /// Floating-point number.
    Real(f64),
    /// Bytes, or UTF-8 text.
    Bytes(Vec<u8>),
}

impl Value {
    /// Returns the integer.
    pub fn integer(&self) -> Option<i64> {
        match self {
            Value::Integer(integer) => Some(*integer),
            _ => None,
        }
    }

    /// Returns the text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Value::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }
}

/// A row: its number, and its values in the order of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number.
    pub number: i64,
    /// Values.
    pub values: Vec<Value>,
}

/// Cause why a file cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SqliteError {
    /// The file is none of SQLite.
    #[error("no SQLite 3 file")]
    NoDatabase,
    /// The text is not UTF-8.
    #[error("an SQLite file whose text is not UTF-8")]
    Encoding,
    /// Changes lie in a file beside it.
    #[error(
        "the writer did not end cleanly: {0} is beside it; `sqlite3 FILE 'pragma wal_checkpoint'` puts them together"
    )]
    Unclean(String),
    /// A page is missing: the file is cut.
    #[error("page {0} is missing: the file is cut")]
    Cut(u32),
    /// A page contradicts itself.
    #[error("page {0} is damaged")]
    Damaged(u32),
    /// The system refused.
    #[error("{0}")]
    Io(String),
}

impl Database {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read, is no SQLite 3 file, or was not closed cleanly.
    pub fn open(path: &Path) -> Result<Database, SqliteError> {
        let io = |error: std::io::Error| SqliteError::Io(error.to_string());
        let file = File::open(path).map_err(io)?;
        let bytes = file.metadata().map_err(io)?.len();
        for ending in ["-wal", "-journal"] {
            let mut beside = path.as_os_str().to_owned();
            beside.push(ending);
            if std::fs::metadata(&beside).is_ok_and(|file| file.len() > 0) {
                return Err(SqliteError::Unclean(beside.to_string_lossy().into_owned()));
            }
        }
        let mut header = [0; HEADER_BYTES];
        file.read_exact_at(&mut header, 0).map_err(|_| SqliteError::NoDatabase)?;
        let page_bytes = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            bytes => usize::from(bytes),
        };
        let usable = page_bytes.saturating_sub(usize::from(header[20]));
        if !header.starts_with(b"SQLite format 3\0") || !page_bytes.is_power_of_two() || usable < 480 {
            return Err(SqliteError::NoDatabase);
        }
        if u32::from_be_bytes([header[56], header[57], header[58], header[59]]) > 1 {
            return Err(SqliteError::Encoding);
        }
        let pages = u32::try_from(bytes.div_ceil(page_bytes as u64)).unwrap_or(u32::MAX);
        Ok(Database { file, page_bytes, usable, pages })
    }

    /// Returns the table `name`; `None` if there is none.
    ///
    /// # Errors
    /// A damaged file.
    pub fn table(&self, name: &str) -> Result<Option<Table>, SqliteError> {
        for row in self.rows(&Table { root: 1, columns: Vec::new() }) {
            let row = row?;
            let [kind, own, _, root, sql, ..] = row.values.as_slice() else { continue };
            if kind.text() == Some("table")
                && own.text() == Some(name)
                && let (Some(root), Some(sql)) = (root.integer(), sql.text())
                && let Ok(root) = u32::try_from(root)
            {
                return Ok(Some(Table { root, columns: columns(sql) }));
            }
        }
        Ok(None)
    }

    /// Returns the rows of a table in the order of their numbers.
    pub fn rows(&self, table: &Table) -> Rows<&Database> {
        Rows::new(self, table)
    }

    fn page(&self, number: u32) -> Result<Vec<u8>, SqliteError> {
        if number == 0 || number > self.pages {
            return Err(SqliteError::Cut(number));
        }
        let mut page = vec![0; self.page_bytes];
        let at = u64::from(number - 1) * self.page_bytes as u64;
        self.file.read_exact_at(&mut page, at).map_err(|_| SqliteError::Cut(number))?;
        Ok(page)
    }

    /// Returns the content of a cell that begins at `at` of the page: `bytes` of it, with its overflow pages.
    fn payload(&self, page: &[u8], number: u32, at: usize, bytes: usize) -> Result<Vec<u8>, SqliteError> {
        let damaged = || SqliteError::Damaged(number);
        if bytes > MAX_ROW_BYTES || bytes as u64 > u64::from(self.pages) * self.page_bytes as u64 {
            return Err(damaged());
        }
        let (max_local, min_local) = (self.usable - 35, (self.usable - 12) * 32 / 255 - 23);
        let spread = min_local + (bytes.saturating_sub(min_local)) % (self.usable - 4);
        let local = match bytes {
            bytes if bytes <= max_local => bytes,
            _ if spread <= max_local => spread,
            _ => min_local,
        };
        let mut payload = page.get(at..at + local).ok_or_else(damaged)?.to_vec();
        if local < bytes {
            let link = page.get(at + local..at + local + 4).ok_or_else(damaged)?;
            let mut next = be_u32(link);
            while payload.len() < bytes {
                let overflow = self.page(next)?;
                let rest = (bytes - payload.len()).min(self.usable - 4);
                payload.extend_from_slice(&overflow[4..4 + rest]);
                next = be_u32(&overflow[..4]);
            }
        }
        Ok(payload)
    }
}

/// Iterator over the rows of a table of a borrowed or an owned file. It ends after an error.
#[derive(Debug)]
pub struct Rows<D> {
    database: D,
    /// Open pages from the root down: number, bytes, and the next cell.
    open: Vec<(u32, Vec<u8>, usize)>,
    /// Page to open next.
    next: Option<u32>,
    /// Number of pages read; more than the file has is a loop.
    read: u32,
}

impl<D: Borrow<Database>> Rows<D> {
    /// Returns the rows of a table in the order of their numbers.
    pub fn new(database: D, table: &Table) -> Self {
        Rows { database, open: Vec::new(), next: Some(table.root), read: 0 }
    }

    fn step(&mut self) -> Result<Option<Row>, SqliteError> {
        let database = self.database.borrow();
        loop {
            if let Some(number) = self.next.take() {
                self.read += 1;
                if self.read > database.pages || self.open.len() >= MAX_DEPTH {
                    return Err(SqliteError::Damaged(number));
                }
                self.open.push((number, database.page(number)?, 0));
            }
            let Some((number, page, cell)) = self.open.last_mut() else { return Ok(None) };
            let (number, damaged) = (*number, SqliteError::Damaged(*number));
            let start = if number == 1 { HEADER_BYTES } else { 0 };
            let kind = page[start];
            let count = usize::from(u16::from_be_bytes([page[start + 3], page[start + 4]]));
            let cells = start + if kind == INTERIOR { 12 } else { 8 };
            let index = std::mem::replace(cell, *cell + 1);
            let position = || {
                let pointer = page.get(cells + 2 * index..cells + 2 * index + 2)?;
                Some(usize::from(u16::from_be_bytes([pointer[0], pointer[1]])))
            };
            match kind {
                LEAF if index < count => {
                    let at = position().ok_or_else(|| damaged.clone())?;
                    let (bytes, at) = varint(page, at).ok_or_else(|| damaged.clone())?;
                    let (row, at) = varint(page, at).ok_or_else(|| damaged.clone())?;
                    let bytes = usize::try_from(bytes).map_err(|_| damaged.clone())?;
                    let payload = database.payload(page, number, at, bytes)?;
                    let values = values(&payload).ok_or(damaged)?;
                    return Ok(Some(Row { number: row as i64, values }));
                }
                INTERIOR if index < count => {
                    let at = position().ok_or_else(|| damaged.clone())?;
                    self.next = Some(be_u32(page.get(at..at + 4).ok_or(damaged)?));
                }
                INTERIOR if index == count => self.next = Some(be_u32(&page[start + 8..start + 12])),
                LEAF | INTERIOR => {
                    self.open.pop();
                }
                _ => return Err(damaged),
            }
        }
    }
}

impl<D: Borrow<Database>> Iterator for Rows<D> {
    type Item = Result<Row, SqliteError>;

    fn next(&mut self) -> Option<Self::Item> {
        let step = self.step();
        if step.is_err() {
            self.open.clear();
            self.next = None;
        }
        step.transpose()
    }
}

fn be_u32(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).fold(0, |number, byte| number << 8 | u32::from(*byte))
}

/// Reads an integer of 1 to 9 bytes, and returns the position behind it.
fn varint(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    let mut number = 0_u64;
    for i in 0..8 {
        let byte = *bytes.get(at + i)?;
        number = number << 7 | u64::from(byte & 0x7f);
        if byte < 0x80 {
            return Some((number, at + i + 1));
        }
    }
    Some((number << 8 | u64::from(*bytes.get(at + 8)?), at + 9))
}

/// Reads the values of a row.
fn values(payload: &[u8]) -> Option<Vec<Value>> {
    let (header, mut at) = varint(payload, 0)?;
    let header = usize::try_from(header).ok().filter(|header| *header <= payload.len())?;
    let mut content = header;
    let mut values = Vec::new();
    while at < header {
        let (code, next) = varint(payload, at)?;
        at = next;
        let bytes = match code {
            0 | 8 | 9 => 0,
            1..=4 => code as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((code - 12) / 2).ok()?,
        };
        let raw = payload.get(content..content.checked_add(bytes)?)?;
        content += bytes;
        values.push(match code {
            0 => Value::Null,
            8 | 9 => Value::Integer(code as i64 - 8),
            7 => Value::Real(f64::from_be_bytes(raw.try_into().ok()?)),
            1..=6 => {
                let sign: i64 = if raw[0] & 0x80 == 0 { 0 } else { -1 };
                Value::Integer(raw.iter().fold(sign, |number, byte| number << 8 | i64::from(*byte)))
            }
            _ => Value::Bytes(raw.to_vec()),
        });
    }
    Some(values)
}

/// Names of the columns in the text that created a table.
fn columns(sql: &str) -> Vec<String> {
    let inside =
        sql.split_once('(').map_or("", |(_, rest)| rest.rsplit_once(')').map_or(rest, |(inside, _)| inside));
    let names = inside.split(',').filter_map(|column| column.split_whitespace().next());
    names.map(|name| name.trim_matches(['"', '`', '[', ']', '\'']).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_all_lengths_are_read() {
        assert_eq!(varint(&[0x07], 0), Some((7, 1)));
        assert_eq!(varint(&[0x81, 0x00], 0), Some((128, 2)));
        assert_eq!(varint(&[0xff; 9], 0), Some((u64::MAX, 9)));
        assert_eq!(varint(&[0xff; 8], 0), None);
        let row = [7, 0, 1, 2, 8, 9, 23, 0xff, 0x12, 0x34, b'h', b'e', b'l', b'l', b'o'];
        let read = values(&row).unwrap();
        let integers: Vec<_> = read.iter().map(Value::integer).collect();
        assert_eq!(integers, [None, Some(-1), Some(0x1234), Some(0), Some(1), None]);
        assert_eq!(read[5].text(), Some("hello"));
        assert!(values(&row[..12]).is_none() && values(&[9, 1]).is_none() && values(&[]).is_none());
    }

    #[test]
    fn columns_are_named_by_the_text_that_made_the_table() {
        let sql = "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL, \"timestamp\" INTEGER, data BLOB)";
        assert_eq!(columns(sql), ["id", "topic_id", "timestamp", "data"]);
        assert!(columns("nonsense").is_empty());
    }
}
