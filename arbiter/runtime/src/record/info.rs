//! Contents of any MCAP file at a glance: topics, types, rates, gaps, time span, facts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::playback::each_message;
use super::{Contents, PlaybackError};

/// Contents of an MCAP file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Info {
    /// File.
    pub path: PathBuf,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Number of messages.
    pub messages: u64,
    /// Time from the first message to the last, s.
    pub seconds: f64,
    /// Topics by name.
    pub topics: BTreeMap<String, TopicInfo>,
    /// Facts of the run; empty for a file of another program.
    pub facts: BTreeMap<String, String>,
    /// Attached files: name and size, bytes.
    pub files: BTreeMap<String, usize>,
    /// Cause why the file ends early; `None` if it is whole.
    pub broken_off: Option<String>,
}

/// Messages of one topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicInfo {
    /// Name of the message type, such as `yamabico.Odometry.v1` or `sensor_msgs/msg/LaserScan`.
    pub message_type: String,
    /// Encoding, such as `json`, `protobuf` or `cdr`.
    pub encoding: String,
    /// Number of messages.
    pub messages: u64,
    /// Number of bytes of their data.
    pub bytes: u64,
    /// Time of the first one after the beginning of the file, s.
    pub first_s: f64,
    /// Messages per second between the first and the last; `None` for a single one.
    pub rate_hz: Option<f64>,
    /// Longest time between two messages, s.
    pub largest_gap_s: f64,
    /// Number of times that the time went back.
    pub steps_back: u64,
}

/// First and last time of a topic, ns.
#[derive(Clone, Copy, Debug)]
struct Span {
    first_ns: u64,
    last_ns: u64,
}

/// Counts the messages of a recording, whatever stores them.
#[derive(Clone, Debug, Default)]
pub struct InfoCounter {
    info: Info,
    spans: BTreeMap<String, Span>,
}

impl InfoCounter {
    /// Returns a counter for the file or folder `path` of `bytes` bytes.
    #[must_use]
    pub fn new(path: &Path, bytes: u64) -> InfoCounter {
        InfoCounter { info: Info { path: path.to_owned(), bytes, ..Info::default() }, spans: BTreeMap::new() }
    }

    /// Counts a message of `bytes` bytes that was recorded at `at_ns`.
    pub fn add(&mut self, name: &str, message_type: &str, encoding: &str, at_ns: u64, bytes: usize) {
        self.info.messages += 1;
        if !self.info.topics.contains_key(name) {
            let (message_type, encoding) = (message_type.to_owned(), encoding.to_owned());
            self.info
                .topics
                .insert(name.to_owned(), TopicInfo { message_type, encoding, ..TopicInfo::default() });
            self.spans.insert(name.to_owned(), Span { first_ns: at_ns, last_ns: at_ns });
        }
        let (Some(topic), Some(span)) = (self.info.topics.get_mut(name), self.spans.get_mut(name)) else {
            return;
        };
        topic.messages += 1;
        topic.bytes += bytes as u64;
        topic.steps_back += u64::from(at_ns < span.last_ns);
        topic.largest_gap_s = topic.largest_gap_s.max(at_ns.saturating_sub(span.last_ns) as f64 * 1e-9);
        *span = Span { first_ns: span.first_ns.min(at_ns), last_ns: span.last_ns.max(at_ns) };
    }

    /// Notes that the recording could not be read further.
    ///
    /// # Errors
    /// The cause, if there was no message before.
    pub fn break_off(&mut self, cause: String) -> Result<(), String> {
        if self.info.messages == 0 {
            return Err(cause);
        }
        self.info.broken_off = Some(format!("after message {}: {cause}", self.info.messages));
        Ok(())
    }

    /// Returns the contents, with rates and times from the beginning of the recording.
    #[must_use]
    pub fn finish(self) -> Info {
        let InfoCounter { mut info, spans } = self;
        let begin = spans.values().map(|span| span.first_ns).min().unwrap_or(0);
        let end = spans.values().map(|span| span.last_ns).max().unwrap_or(0);
        info.seconds = (end - begin) as f64 * 1e-9;
        for (name, topic) in &mut info.topics {
            let Some(span) = spans.get(name) else { continue };
            topic.first_s = (span.first_ns - begin) as f64 * 1e-9;
            let length_s = (span.last_ns - span.first_ns) as f64 * 1e-9;
            topic.rate_hz = (length_s > 0.0).then(|| (topic.messages - 1) as f64 / length_s);
        }
        info
    }
}

/// Reads the contents of the MCAP file `path`, one of this program or of another.
///
/// # Errors
/// The file cannot be read or is no MCAP file.
pub fn info(path: &Path) -> Result<Info, PlaybackError> {
    let Contents { facts, files } = Contents::read(path)?;
    let bytes = std::fs::metadata(path)
        .map_err(|source| PlaybackError::NotReadable { path: path.to_owned(), source })?
        .len();
    let mut counter = InfoCounter::new(path, bytes);
    let broken_off = each_message(
        path,
        |_| true,
        |message| {
            let channel = message.channel;
            let message_type = channel.schema.as_ref().map_or("", |schema| &schema.name);
            counter.add(
                &channel.topic,
                message_type,
                &channel.encoding,
                message.log_time,
                message.data.len(),
            );
            Ok::<(), PlaybackError>(())
        },
    )?;
    if let Some(cause) = broken_off {
        let refused = |reason| PlaybackError::NoRecording { path: path.to_owned(), reason };
        counter.break_off(cause).map_err(refused)?;
    }
    let mut info = counter.finish();
    info.facts = facts;
    info.files = files.into_iter().map(|(name, text)| (name, text.len())).collect();
    Ok(info)
}
