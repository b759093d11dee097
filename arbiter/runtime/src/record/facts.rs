//! Facts in a recording besides its messages.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};

use super::contents::reader_options;
use super::{Contents, PlaybackError};

/// Bytes that are read at once.
const READ_BYTES: usize = 1 << 20;

/// Facts known before a run, and those known after it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedFacts {
    /// Facts known before the run, such as its seed.
    pub run: BTreeMap<String, String>,
    /// Facts known after the run, such as its digest; empty if its recorder was killed.
    pub result: BTreeMap<String, String>,
}

/// Reads the facts of a recording up to its end, or up to where it was cut off. Messages are skipped.
///
/// # Errors
/// The file cannot be read or is no recording.
pub fn read_facts(path: &Path) -> Result<RecordedFacts, PlaybackError> {
    let unreadable = |source| PlaybackError::NotReadable { path: path.to_owned(), source };
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let mut reader = LinearReader::new_with_options(reader_options().with_emit_chunks(true));
    let mut facts = RecordedFacts { run: Contents::read(path)?.facts, ..RecordedFacts::default() };
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                let read = file.read(reader.insert(bytes.min(READ_BYTES))).map_err(unreadable)?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { data, opcode: op::METADATA }) => {
                if let Ok(Record::Metadata(metadata)) = mcap::parse_record(op::METADATA, data)
                    && metadata.name == "result"
                {
                    facts.result = metadata.metadata;
                }
            }
            Ok(LinearReadEvent::Record { .. }) => {}
            // What was read so far holds.
            Err(_) => break,
        }
    }
    Ok(facts)
}
