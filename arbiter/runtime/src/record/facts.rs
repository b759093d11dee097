//! Facts in a recording besides its messages.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::PlaybackError;

/// Bytes that are read at once.
const READ_BYTES: usize = 1 << 20;

/// Facts known before a run, and those known after it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedFacts {
    /// Facts known before the run: seed, version, overrides.
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
    let mut reader = LinearReader::new_with_options(LinearReaderOptions::default().with_emit_chunks(true));
    let (mut facts, mut has_begun) = (RecordedFacts::default(), false);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                let read = file.read(reader.insert(bytes.min(READ_BYTES))).map_err(unreadable)?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                has_begun = true;
                if opcode == mcap::records::op::METADATA
                    && let Ok(Record::Metadata(metadata)) = mcap::parse_record(opcode, data)
                {
                    match metadata.name.as_str() {
                        "run" => facts.run = metadata.metadata,
                        "result" => facts.result = metadata.metadata,
                        _ => {}
                    }
                }
            }
            // What was read so far holds.
            Err(_) if has_begun => break,
            Err(error) => {
                let reason = error.to_string();
                return Err(PlaybackError::NoRecording { path: path.to_owned(), reason });
            }
        }
    }
    Ok(facts)
}
