//! The last minute of a running robot, ready to be saved as a recording.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::record::{ImageFormat, McapRecorder, Pace, Recording, Tap, utc};

/// Time that is kept.
pub const KEPT: Duration = Duration::from_secs(60);
/// Maximum size of the messages, bytes; beyond it the oldest are dropped earlier.
const MAX_BYTES: usize = 64 << 20;
/// Memory of a message besides its bytes.
const OVERHEAD: usize = 128;

/// Messages of the last minute; images are compressed.
#[derive(Clone, Default)]
pub struct Recent {
    entries: VecDeque<Entry>,
    topics: BTreeMap<String, Arc<str>>,
    bytes: usize,
}

#[derive(Clone)]
struct Entry {
    topic: Arc<str>,
    message: MessageType,
    time: Time,
    header: Arc<[u8]>,
    items: Arc<[u8]>,
}

impl Entry {
    fn size(&self) -> usize {
        self.header.len() + self.items.len() + OVERHEAD
    }
}

impl Recent {
    /// Takes in a message; the items of a frame are its compressed picture.
    pub fn add(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: Arc<[u8]>) {
        let topic = match self.topics.get(topic) {
            Some(known) => Arc::clone(known),
            None => Arc::clone(self.topics.entry(topic.to_owned()).or_insert(topic.into())),
        };
        let entry = Entry { topic, message: *message, time, header: header.into(), items };
        self.bytes += entry.size();
        self.entries.push_back(entry);
        while let Some(oldest) = self.entries.front()
            && (self.bytes > MAX_BYTES || time.since(oldest.time) > KEPT)
        {
            self.bytes -= oldest.size();
            self.entries.pop_front();
        }
    }

    /// Number of messages.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns true if there is none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Writes the messages to a new recording; returns its size, bytes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<u64, String> {
        let recording = Recording { images: ImageFormat::IsJpeg, ..Recording::new(path, Pace::Lockstep) };
        let mut recorder = McapRecorder::create(recording).map_err(|error| error.to_string())?;
        for Entry { topic, message, time, header, items } in &self.entries {
            recorder.message(topic, message, *time, header, items);
        }
        let result = recorder.finish(BTreeMap::new());
        result.error.map_or(Ok(result.bytes), |error| Err(error.to_string()))
    }
}

/// File name for a recording of `robot` that is saved at `now`, such as `kame-2026-11-23T18-04-05Z.mcap`.
pub fn file_name(robot: &str, now: SystemTime) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let robot: String = robot.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let time = utc(now).replace(':', "-");
    format!("{robot}-{}Z.mcap", time.get(..19).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::UNIX_EPOCH;
    use yamabico_core::message::Odometry;

    #[test]
    fn a_file_is_named_after_the_robot_and_the_time() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        assert_eq!(file_name("kame", at(951_782_400)), "kame-2000-02-29T00-00-00Z.mcap");
        assert_eq!(file_name("../a b", at(1_795_457_045)), "___a_b-2026-11-23T18-04-05Z.mcap");
    }

    #[test]
    fn the_last_minute_is_kept_in_bounded_memory() {
        let mut recent = Recent::default();
        let message = MessageType::of::<Odometry>();
        for second in 0..200 {
            recent.add("wheels", &message, Time(second * 1_000_000_000), &[0; 8], vec![].into());
        }
        assert_eq!(recent.len(), 61);
        for _ in 0..100 {
            recent.add("front", &message, Time(200_000_000_000), &[], vec![0; 1 << 20].into());
        }
        assert!(recent.bytes <= MAX_BYTES && recent.len() == 63, "{}", recent.len());
    }
}
