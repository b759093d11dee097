//! Facts in a recording besides its messages.

use std::collections::BTreeMap;
use std::path::Path;

use yamabico_mcap::{Metadata, Opcode, Records};

use super::{Contents, PlaybackError};

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
    let mut facts = RecordedFacts { run: Contents::read(path)?.facts, ..RecordedFacts::default() };
    let mut records = Records::open(path).map_err(|error| PlaybackError::new(path, error))?;
    // What was read up to a broken end holds.
    while let Ok(Some(record)) = records.next() {
        if record.opcode == Opcode::METADATA
            && let Ok(body) = records.body(&record)
            && let Some(Metadata { name, facts: result }) = Metadata::read(body)
            && name == "result"
        {
            facts.result = result;
        }
    }
    Ok(facts)
}
