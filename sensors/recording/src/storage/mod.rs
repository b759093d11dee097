//! The files of a recording, whatever stores them: MCAP, or a folder of rosbag2 with MCAP or SQLite files.

mod bag_folder;
mod mcap_file;
pub mod sqlite;
mod sqlite_bag;

use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use mcap_file::origin;

/// Type of the messages of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name, such as `/scan`.
    pub name: String,
    /// Message type, such as `sensor_msgs/msg/LaserScan`.
    pub message_type: String,
    /// Encoding: `cdr` for ROS 2, `json` or `protobuf` for this program.
    pub encoding: String,
}

/// One recorded message.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredMessage {
    /// Its topic.
    pub topic: Arc<Topic>,
    /// Time at which it was recorded, ns.
    pub log_time: u64,
    /// Encoded message.
    pub data: Vec<u8>,
}

/// Messages of a recording, file by file, in the order in which they were written.
pub struct Messages {
    paths: std::vec::IntoIter<PathBuf>,
    open: Option<Box<dyn Iterator<Item = Result<StoredMessage, String>> + Send>>,
}

impl Messages {
    /// Opens the MCAP file, SQLite file or rosbag2 folder `path`.
    ///
    /// # Errors
    /// The description of what cannot be read, with the remedy.
    pub fn open(path: &Path) -> Result<Messages, String> {
        let paths = match path.is_dir() {
            true => bag_folder::files(path)?,
            false => vec![path.to_owned()],
        };
        let mut messages = Messages { paths: paths.into_iter(), open: None };
        messages.open_next().transpose()?;
        Ok(messages)
    }

    fn open_next(&mut self) -> Option<Result<(), String>> {
        let path = self.paths.next()?;
        let opened: Result<Box<dyn Iterator<Item = _> + Send>, String> = match kind_of(&path) {
            Ok(Kind::Mcap) => mcap_file::messages(&path).map(|messages| Box::new(messages) as _),
            Ok(Kind::Sqlite) => sqlite_bag::messages(&path).map(|messages| Box::new(messages) as _),
            Err(error) => Err(error),
        };
        Some(opened.map(|messages| self.open = Some(messages)).map_err(|error| named(&path, &error)))
    }
}

impl Iterator for Messages {
    type Item = Result<StoredMessage, String>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.open.as_mut()?.next() {
                if message.is_err() {
                    self.open = None;
                }
                return Some(message);
            }
            self.open = None;
            if let Err(error) = self.open_next()? {
                return Some(Err(error));
            }
        }
    }
}

/// Returns true for an MCAP file.
#[must_use]
pub fn is_mcap(path: &Path) -> bool {
    path.is_file() && matches!(kind_of(path), Ok(Kind::Mcap))
}

/// Returns the size of a recording on the disk, bytes; without the files that cannot be read.
#[must_use]
pub fn bytes(path: &Path) -> u64 {
    let files =
        if path.is_dir() { bag_folder::files(path).unwrap_or_default() } else { vec![path.to_owned()] };
    files.iter().filter_map(|file| std::fs::metadata(file).ok()).map(|file| file.len()).sum()
}

fn named(path: &Path, error: &str) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    format!("{}: {error}", name.to_string_lossy())
}

enum Kind {
    Mcap,
    Sqlite,
}

/// Tells the kind of a file from its first bytes.
fn kind_of(path: &Path) -> Result<Kind, String> {
    use std::io::Read;
    let mut begin = Vec::new();
    let file = std::fs::File::open(path).map_err(|error| error.to_string())?;
    file.take(16).read_to_end(&mut begin).map_err(|error| error.to_string())?;
    match begin.as_slice() {
        [] => Err("the file is empty".to_owned()),
        begin if begin.starts_with(b"\x89MCAP") => Ok(Kind::Mcap),
        begin if begin.starts_with(b"SQLite format 3\0") => Ok(Kind::Sqlite),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => {
            Err("the whole file is compressed: `zstd -d FILE` unpacks it, then name the folder without `compression_mode`".into())
        }
        _ => Err("neither an MCAP nor an SQLite file".to_owned()),
    }
}
