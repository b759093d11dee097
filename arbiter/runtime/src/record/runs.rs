//! Several recordings in one file, one after the other, as `cat` joins them.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use mcap::MAGIC;
use mcap::records::op;

use super::PlaybackError;

/// Size of a record's opcode and length, bytes.
const PREFIX_BYTES: u64 = 9;

/// Places of the recordings in the file `path`, bytes. A file that breaks off, or is no recording, is one.
///
/// # Errors
/// The file cannot be read.
pub fn runs(path: &Path) -> Result<Vec<Range<u64>>, PlaybackError> {
    let unreadable = |source| PlaybackError::NotReadable { path: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    let (mut file, mut found, mut begin) = (BufReader::new(file), Vec::new(), 0);
    while let Some(end) = end_of_run(&mut file, begin).filter(|end| *end < length) {
        found.push(begin..end);
        begin = end;
    }
    found.push(begin..length);
    Ok(found)
}

/// End of the recording that begins at `begin`, if it has one and another begins there.
fn end_of_run(file: &mut (impl Read + Seek), begin: u64) -> Option<u64> {
    let mut at = begin + MAGIC.len() as u64;
    loop {
        file.seek(SeekFrom::Start(at)).ok()?;
        let mut prefix = [0; PREFIX_BYTES as usize];
        file.read_exact(&mut prefix).ok()?;
        let (opcode, length) = prefix.split_first()?;
        at = at.checked_add(PREFIX_BYTES)?.checked_add(u64::from_le_bytes(length.try_into().ok()?))?;
        if *opcode == op::FOOTER {
            // The end of this one, and the beginning of the next.
            let mut magic = [0; 2 * MAGIC.len()];
            file.seek(SeekFrom::Start(at)).ok()?;
            file.read_exact(&mut magic).ok()?;
            let (end, next) = magic.split_at(MAGIC.len());
            return (end == MAGIC && next == MAGIC).then_some(at + MAGIC.len() as u64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{McapRecorder, Pace, Recording};

    #[test]
    fn recordings_are_found_one_after_the_other() {
        let folder = std::env::temp_dir().join(format!("yamabico-runs-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let one = folder.join("one.mcap");
        let recorder = McapRecorder::create(Recording::new(&one, Pace::Lockstep)).unwrap();
        assert!(recorder.finish(Default::default()).error.is_none());
        let bytes = std::fs::read(&one).unwrap();
        let length = bytes.len() as u64;
        // Ends of the runs; each starts where the one before ends.
        let of = |bytes: &[u8]| {
            let file = folder.join("file.mcap");
            std::fs::write(&file, bytes).unwrap();
            let runs = runs(&file).unwrap();
            let starts = [0].into_iter().chain(runs.iter().map(|run| run.end));
            assert!(runs.iter().zip(starts).all(|(run, start)| run.start == start), "{runs:?}");
            runs.iter().map(|run| run.end).collect::<Vec<_>>()
        };
        assert_eq!(of(&bytes), [length]);
        assert_eq!(of(&[&bytes[..], &bytes, &bytes].concat()), [length, 2 * length, 3 * length]);
        // The second one was cut off.
        assert_eq!(of(&[&bytes[..], &bytes[..bytes.len() / 2]].concat()), [length, length + length / 2]);
        assert_eq!(of(&bytes[..bytes.len() / 2]), [length / 2]);
        assert_eq!((of(b""), of(b"no recording")), (vec![0], vec![12]));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
