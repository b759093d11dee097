//! Folder of rosbag2: its `metadata.yaml` names the files in the order in which they were written.

use std::path::{Path, PathBuf};

/// Maximum size of `metadata.yaml`, bytes.
const MAX_METADATA_BYTES: u64 = 16 << 20;

/// Returns the files of the folder.
///
/// # Errors
/// There is no readable `metadata.yaml`, it names no files, or its messages are compressed one by one.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let path = folder.join("metadata.yaml");
    let size = std::fs::metadata(&path).map(|file| file.len());
    let size = size.map_err(|error| format!("a folder without a readable metadata.yaml: {error}"))?;
    if size > MAX_METADATA_BYTES {
        return Err(format!("metadata.yaml has {size} bytes"));
    }
    let text = std::fs::read_to_string(&path).map_err(|error| format!("metadata.yaml: {error}"))?;
    if value(&text, "compression_mode").is_some_and(|mode| mode.eq_ignore_ascii_case("message")) {
        return Err("its messages are compressed one by one: `ros2 bag convert` unpacks them".to_owned());
    }
    let files: Vec<PathBuf> = list(&text, "relative_file_paths").map(|name| folder.join(name)).collect();
    match files.is_empty() {
        true => Err("metadata.yaml names no files under relative_file_paths".to_owned()),
        false => Ok(files),
    }
}

fn unquoted(text: &str) -> &str {
    text.trim().trim_matches(['"', '\''])
}

fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let found = text.lines().find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'));
    found.map(unquoted).filter(|value| !value.is_empty())
}

/// Entries of the list under `key`, one a line: all that rosbag2 writes.
fn list<'a>(text: &'a str, key: &str) -> impl Iterator<Item = &'a str> {
    let is_key = move |line: &&str| line.trim().strip_prefix(key) == Some(":");
    let behind = text.lines().skip_while(move |line| !is_key(line)).skip(1);
    behind.map_while(|line| line.trim().strip_prefix("- ")).map(unquoted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_listed_in_their_order() {
        let text = "rosbag2_bagfile_information:\n  storage_identifier: sqlite3\n  relative_file_paths:\n    - a_0.db3\n    - \"a_1.db3\"\n  compression_mode: \"\"\n";
        assert_eq!(list(text, "relative_file_paths").collect::<Vec<_>>(), ["a_0.db3", "a_1.db3"]);
        assert_eq!(
            (value(text, "storage_identifier"), value(text, "compression_mode")),
            (Some("sqlite3"), None)
        );
        assert_eq!(list("nothing", "relative_file_paths").count(), 0);
    }
}
