//! Capture times of the images of a sequence: from a rate, from the names of the files, or from a CSV table.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::files::SequenceError;

/// Maximum size of a table, bytes.
const MAX_TABLE_BYTES: u64 = 64 << 20;

/// Value of the key `stamps` for times from a rate, and from the names of the files.
pub(crate) const RATE: &str = "rate";
const NAMES: &str = "names";

/// Reads the capture times of `files`, ns after the first; `None` for images at a constant rate. `stamps` is `rate`, `names`, or the
/// path of a table.
///
/// # Errors
/// A name without a time, a table without one of the files, and times that do not grow.
pub(crate) fn read(
    stamps: &str,
    files: &[PathBuf],
    folder: &Path,
) -> Result<Option<Vec<u64>>, SequenceError> {
    let times = match stamps {
        RATE => return Ok(None),
        NAMES => files.iter().map(|file| of_name(file)).collect::<Result<Vec<u64>, _>>()?,
        table => {
            let path = folder.join(table);
            let unreadable = |source| SequenceError::Unreadable { path: path.clone(), source };
            let size = std::fs::metadata(&path).map_err(unreadable)?.len();
            if size > MAX_TABLE_BYTES {
                return Err(refused(&path, format!("{size} bytes are too many for a table of stamps")));
            }
            let text = std::fs::read_to_string(&path).map_err(unreadable)?;
            of_table(&text, files, &path)?
        }
    };
    let growing = files.iter().skip(1).zip(times.windows(2)).find(|(_, pair)| pair[1] <= pair[0]);
    match growing {
        Some((file, _)) => Err(refused(file, "its time is not after that of the image before it".to_owned())),
        None => Ok(times.first().map(|first| times.iter().map(|time| time - first).collect())),
    }
}

fn refused(path: &Path, reason: String) -> SequenceError {
    SequenceError::Stamps { path: path.to_owned(), reason }
}

fn of_name(file: &Path) -> Result<u64, SequenceError> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let problem = || {
        let reason = "its name is no time: use seconds with a point, or ms, us or ns since 1970, such as 1403636579763555584.png";
        refused(file, reason.to_owned())
    };
    nanoseconds(&stem).ok_or_else(problem)
}

/// Times of the files by a table whose lines hold the name of a file and its time, in any order, with a comma between.
fn of_table(text: &str, files: &[PathBuf], path: &Path) -> Result<Vec<u64>, SequenceError> {
    let mut by_name = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut cells = line.split(',').map(str::trim);
        let (Some(first), Some(second)) = (cells.next(), cells.next()) else { continue };
        // The name may look like a time: `1403636579763555584.png`.
        let time = |cell: &str| nanoseconds(cell).or_else(|| Some((cell.parse::<f64>().ok()? * 1e9) as u64));
        let entry = time(first).map(|time| (second, time)).or_else(|| Some((first, time(second)?)));
        by_name.extend(entry);
    }
    let time_of = |file: &PathBuf| {
        let name = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let found = by_name
            .get(name(file.file_name()).as_str())
            .or_else(|| by_name.get(name(file.file_stem()).as_str()));
        found.copied().ok_or_else(|| refused(path, format!("it has no time for {}", name(file.file_name()))))
    };
    files.iter().map(time_of).collect()
}

/// Reads a time as seconds with a point, or as ms, us or ns since 1970 by the number of digits.
fn nanoseconds(text: &str) -> Option<u64> {
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if let Some((seconds, fraction)) = text.split_once('.') {
        if !is_digits(seconds) || !is_digits(fraction) || fraction.len() > 9 {
            return None;
        }
        let nanoseconds = fraction.parse::<u64>().ok()? * 10_u64.pow(9 - fraction.len() as u32);
        return seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanoseconds);
    }
    let unit = match (is_digits(text), text.len()) {
        (true, 18..=19) => 1,
        (true, 15..=16) => 1_000,
        (true, 12..=13) => 1_000_000,
        _ => return None,
    };
    text.parse::<u64>().ok()?.checked_mul(unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_by_their_digits() {
        for text in ["1403636579763555584", "1403636579.763555584"] {
            assert_eq!(nanoseconds(text), Some(1_403_636_579_763_555_584));
        }
        assert_eq!(nanoseconds("1403636579763555"), Some(1_403_636_579_763_555_000));
        assert_eq!(nanoseconds("1403636579763"), Some(1_403_636_579_763_000_000));
        assert_eq!(nanoseconds("1305031102.1753"), Some(1_305_031_102_175_300_000));
        for text in ["", "frame_0001", "0001", "1.2.3", "-5.0", "99999999999999999999.0"] {
            assert_eq!(nanoseconds(text), None, "{text}");
        }
    }

    #[test]
    fn a_table_gives_the_times_in_any_order_of_its_columns() {
        let files = [PathBuf::from("a/one.png"), PathBuf::from("a/two.png")];
        let read = |text: &str| of_table(text, &files, Path::new("t.csv"));
        assert_eq!(
            read("#timestamp [ns],filename\n1403636579763555584,one.png\n1403636579863555584,two.png\n")
                .unwrap()[1],
            1_403_636_579_863_555_584
        );
        assert_eq!(read("file,seconds\none,0.5\ntwo,0.75").unwrap(), [500_000_000, 750_000_000]);
        let problem = read("one.png,1.0").unwrap_err().to_string();
        assert!(problem.contains("t.csv") && problem.contains("two.png"), "{problem}");
    }
}
