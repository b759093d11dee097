//! Beginning of a recording: its facts and its attached files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};

use yamabico_core::time::Time;

use super::PlaybackError;
use super::identity::{RecordedIdentity, stays_inside};

/// Maximum length of one record, bytes; a longer one is refused before memory is reserved for it.
pub(super) const MAX_RECORD_BYTES: usize = 128 << 20;
/// Maximum size of all attached files, bytes.
const MAX_FILES_BYTES: usize = 64 << 20;
/// Name of the record with the facts of a run.
pub(super) const RUN: &str = "run";

/// Fact of a repaired recording: the cause why it broke off.
pub(super) const BROKE_OFF: &str = "broke_off";

/// Facts and attached files of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// Facts of the run, by key.
    pub facts: BTreeMap<String, String>,
    /// Attached files: name and text.
    pub files: Vec<(String, String)>,
}

/// Options of every reader of recordings.
pub(super) fn reader_options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES)
}

/// Cause why a recording that was read without an error ends early; `None` if it has its end.
pub(super) fn missing_end(file: &mut (impl Read + Seek)) -> Option<String> {
    let mut end = [0; mcap::MAGIC.len()];
    let offset = -(mcap::MAGIC.len() as i64);
    let read = file.seek(SeekFrom::End(offset)).and_then(|_| file.read_exact(&mut end));
    (read.is_err() || end != mcap::MAGIC).then(|| "it has no end, as after a kill".to_owned())
}

impl Contents {
    /// Reads the beginning of a recording, up to its first messages.
    ///
    /// # Errors
    /// The file cannot be read or is no recording.
    pub fn read(path: &Path) -> Result<Contents, PlaybackError> {
        let file = File::open(path)
            .map_err(|source| PlaybackError::NotReadable { path: path.to_owned(), source })?;
        let refused = |reason: String| PlaybackError::NoRecording { path: path.to_owned(), reason };
        Contents::read_from(BufReader::new(file)).map_err(refused)
    }

    fn read_from(mut source: impl Read) -> Result<Contents, String> {
        let mut reader = LinearReader::new_with_options(reader_options().with_emit_chunks(true));
        let (mut contents, mut bytes, mut records) = (Contents::default(), 0, 0);
        while let Some(event) = reader.next_event() {
            let record = match event {
                Ok(LinearReadEvent::ReadRequest(need)) => {
                    let read = source.read(reader.insert(need)).map_err(|error| error.to_string())?;
                    reader.notify_read(read);
                    continue;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => (opcode, data),
                // What the file holds up to a broken end counts.
                Err(_) if records > 0 => break,
                Err(error) => return Err(error.to_string()),
            };
            records += 1;
            match record {
                (op::METADATA, data) => {
                    let (name, facts) = metadata(data).ok_or("it has a malformed record of facts")?;
                    if name == RUN && contents.facts.is_empty() {
                        contents.facts = facts;
                    }
                }
                (op::ATTACHMENT, data) => {
                    bytes += data.len();
                    if bytes > MAX_FILES_BYTES {
                        return Err(format!("its attached files have more than {MAX_FILES_BYTES} bytes"));
                    }
                    contents.files.extend(attachment(data));
                }
                (op::CHUNK | op::MESSAGE, _) if !contents.facts.is_empty() => break,
                _ => {}
            }
        }
        Ok(contents)
    }

    /// Stamp on the clock of the run at time zero of the recording; zero for a recording without facts.
    #[must_use]
    pub fn origin(&self) -> Time {
        Time(self.facts.get("origin_ns").and_then(|text| text.parse().ok()).unwrap_or(0))
    }

    /// Identity of the run.
    ///
    /// # Errors
    /// The name of a missing or malformed fact.
    pub fn identity(&self) -> Result<RecordedIdentity, String> {
        RecordedIdentity::from_facts(&self.facts)
    }

    /// Writes the attached files into `folder`.
    ///
    /// # Errors
    /// A file cannot be written, or its name points out of the folder.
    pub fn unpack(&self, folder: &Path) -> std::io::Result<()> {
        for (name, text) in &self.files {
            if !stays_inside(name) {
                let problem = format!("the attached file `{name}` points out of its folder");
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, problem));
            }
            let path: PathBuf = folder.join(name);
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent)?;
            }
            std::fs::write(path, text)?;
        }
        Ok(())
    }
}

/// Name and facts of a record of metadata; `None` if a length in it lies.
fn metadata(data: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut fields = Fields(data);
    let name = fields.text()?;
    let length = fields.u32()? as usize;
    let mut pairs = Fields(fields.bytes(length)?);
    let mut facts = BTreeMap::new();
    while !pairs.0.is_empty() {
        facts.insert(pairs.text()?, pairs.text()?);
    }
    Some((name, facts))
}

/// Name and text of an attachment; `None` if a length in it lies, or if it is no text.
fn attachment(data: &[u8]) -> Option<(String, String)> {
    let mut fields = Fields(data);
    let _log_time = fields.u64()?;
    let _create_time = fields.u64()?;
    let name = fields.text()?;
    let _media_type = fields.text()?;
    let length = usize::try_from(fields.u64()?).ok()?;
    let text = fields.bytes(length)?;
    Some((name, String::from_utf8(text.to_vec()).ok()?))
}

/// Fields of a record, little endian.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.bytes(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.bytes(8)?.try_into().ok()?))
    }

    fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        String::from_utf8(self.bytes(length)?.to_vec()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_lie_are_refused() {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let pair = [text("seed"), text("7")].concat();
        let whole = [text("run"), (pair.len() as u32).to_le_bytes().to_vec(), pair.clone()].concat();
        assert_eq!(metadata(&whole).unwrap().1["seed"], "7");
        for end in 0..whole.len() {
            assert!(metadata(&whole[..end]).is_none(), "{end}");
        }
        let long = [text("run"), u32::MAX.to_le_bytes().to_vec(), pair].concat();
        assert!(metadata(&long).is_none());
        let head = [vec![0; 16], text("a.toml"), text("")].concat();
        let file = [head.clone(), 2_u64.to_le_bytes().to_vec(), b"ok".to_vec(), vec![0; 4]].concat();
        assert_eq!(attachment(&file).unwrap(), ("a.toml".into(), "ok".into()));
        let lie = [head, u64::MAX.to_le_bytes().to_vec(), b"ok".to_vec()].concat();
        assert!(attachment(&lie).is_none() && attachment(&[]).is_none());
    }

    #[test]
    fn names_that_point_outside_are_not_written() {
        let folder = std::env::temp_dir().join(format!("yamabico-unpack-{}", std::process::id()));
        for name in ["../evil.toml", "/evil.toml", ""] {
            let contents = Contents { files: vec![(name.into(), String::new())], ..Contents::default() };
            assert!(contents.unpack(&folder).is_err(), "{name}");
        }
        let contents = Contents { files: vec![("maps/a.toml".into(), "x".into())], ..Contents::default() };
        contents.unpack(&folder).unwrap();
        assert_eq!(std::fs::read_to_string(folder.join("maps/a.toml")).unwrap(), "x");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
