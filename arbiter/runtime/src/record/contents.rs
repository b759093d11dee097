//! Beginning of a recording: its facts and its attached files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use yamabico_core::time::Time;
use yamabico_mcap::{Attachment, Metadata, Opcode, Records};

use super::PlaybackError;
use super::identity::{RecordedIdentity, stays_inside};

/// Maximum size of all attached files, bytes.
const MAX_FILES_BYTES: u64 = 64 << 20;
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

impl Contents {
    /// Reads the beginning of a recording, up to its first messages.
    ///
    /// # Errors
    /// The file cannot be read or is no recording.
    pub fn read(path: &Path) -> Result<Contents, PlaybackError> {
        let refused = |reason: String| PlaybackError::NoRecording { path: path.to_owned(), reason };
        let mut records = Records::open(path).map_err(|error| PlaybackError::new(path, error))?;
        let (mut contents, mut bytes) = (Contents::default(), 0);
        // What the file holds up to a broken end counts.
        while let Ok(Some(record)) = records.next() {
            match record.opcode {
                Opcode::METADATA => {
                    let Ok(body) = records.body(&record) else { break };
                    let facts = Metadata::read(body);
                    let facts = facts.ok_or_else(|| refused("it has a malformed record of facts".into()))?;
                    if facts.name == RUN && contents.facts.is_empty() {
                        contents.facts = facts.facts;
                    }
                }
                Opcode::ATTACHMENT => {
                    bytes += record.bytes;
                    if bytes > MAX_FILES_BYTES {
                        let reason = format!("its attached files have more than {MAX_FILES_BYTES} bytes");
                        return Err(refused(reason));
                    }
                    let Ok(body) = records.body(&record) else { break };
                    contents.files.extend(Attachment::read(body).and_then(text));
                }
                Opcode::CHUNK | Opcode::MESSAGE if !contents.facts.is_empty() => break,
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

/// Name and text of an attached file; `None` if it is no text.
fn text(file: Attachment<'_>) -> Option<(String, String)> {
    Some((file.name.to_owned(), std::str::from_utf8(file.data).ok()?.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

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
