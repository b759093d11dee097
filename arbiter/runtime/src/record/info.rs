//! Contents of any MCAP file at a glance: topics, types, rates, gaps, time span, facts.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::io::MessageReader;
use serde::Serialize;

use super::PlaybackError;
use super::contents::{Contents, missing_end, reader_options};

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
#[derive(Clone, Copy)]
struct Span {
    first_ns: u64,
    last_ns: u64,
}

/// Reads the contents of the MCAP file `path`, one of this program or of another.
///
/// # Errors
/// The file cannot be read or is no MCAP file.
pub fn info(path: &Path) -> Result<Info, PlaybackError> {
    let Contents { facts, files } = Contents::read(path)?;
    let unreadable = |source| PlaybackError::NotReadable { path: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    let mut info = Info {
        path: path.to_owned(),
        bytes: file.metadata().map_err(unreadable)?.len(),
        facts,
        files: files.into_iter().map(|(name, text)| (name, text.len())).collect(),
        ..Info::default()
    };
    let mut spans: BTreeMap<String, Span> = BTreeMap::new();
    let mut messages = MessageReader::new_with_options(BufReader::new(file), reader_options());
    for message in &mut messages {
        let message = match message {
            Ok(message) => message,
            Err(error) if info.messages > 0 => {
                info.broken_off = Some(format!("after message {}: {error}", info.messages));
                break;
            }
            Err(error) => {
                let reason = error.to_string();
                return Err(PlaybackError::NoRecording { path: path.to_owned(), reason });
            }
        };
        info.messages += 1;
        let (name, at_ns) = (&message.channel.topic, message.log_time);
        if !info.topics.contains_key(name) {
            let schema = message.channel.schema.as_ref().map_or("", |schema| &schema.name);
            let encoding = message.channel.message_encoding.clone();
            let topic = TopicInfo { message_type: schema.to_owned(), encoding, ..TopicInfo::default() };
            info.topics.insert(name.clone(), topic);
        }
        let Some(topic) = info.topics.get_mut(name) else { continue };
        topic.messages += 1;
        topic.bytes += message.data.len() as u64;
        let span = spans.entry(name.clone()).or_insert(Span { first_ns: at_ns, last_ns: at_ns });
        topic.steps_back += u64::from(at_ns < span.last_ns);
        topic.largest_gap_s = topic.largest_gap_s.max(at_ns.saturating_sub(span.last_ns) as f64 * 1e-9);
        *span = Span { first_ns: span.first_ns.min(at_ns), last_ns: span.last_ns.max(at_ns) };
    }
    if info.broken_off.is_none() {
        info.broken_off = missing_end(&mut messages.into_inner());
    }
    let begin = spans.values().map(|span| span.first_ns).min().unwrap_or(0);
    let end = spans.values().map(|span| span.last_ns).max().unwrap_or(0);
    info.seconds = (end - begin) as f64 * 1e-9;
    for (name, topic) in &mut info.topics {
        let Some(span) = spans.get(name) else { continue };
        topic.first_s = (span.first_ns - begin) as f64 * 1e-9;
        let length_s = (span.last_ns - span.first_ns) as f64 * 1e-9;
        topic.rate_hz = (length_s > 0.0).then(|| (topic.messages - 1) as f64 / length_s);
    }
    Ok(info)
}
