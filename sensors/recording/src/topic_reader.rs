//! Measurements of one topic of a recording, in the order of time.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::measurement::{Measurement, Refusal};
use crate::storage::{Messages, StoredMessage, origin};
use crate::{ros2, yamabico};

/// Failure to open a topic of a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read or is no recording.
    #[error("{}: {reason}; name an MCAP file, or a folder of rosbag2, that `yamabico info` reads", path.display())]
    File {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The file has no such topic.
    #[error("{} has no topic `{topic}` with messages; it has: {has}", path.display())]
    NoTopic {
        /// File.
        path: PathBuf,
        /// Missing topic.
        topic: String,
        /// Topics of the file.
        has: String,
    },
    /// The topic holds something else.
    #[error("topic `{topic}` holds `{found}`, and not {expected}")]
    Type {
        /// Topic.
        topic: String,
        /// Its message type.
        found: String,
        /// Expected measurement.
        expected: &'static str,
    },
}

impl RecordingError {
    /// Key of the table to change.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            RecordingError::File { .. } => "file",
            RecordingError::NoTopic { .. } | RecordingError::Type { .. } => "topic",
        }
    }
}

/// Encoding of the messages of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Source {
    /// Messages of this program, by their type.
    Yamabico(String),
    /// Messages of ROS 2, by their type.
    Ros2(String),
}

/// A measurement with the time at which it was recorded, both ns after the beginning of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Time at which it arrived.
    pub arrived_ns: u64,
    /// Time of the measurement.
    pub stamp_ns: u64,
    /// Measurement.
    pub measurement: Measurement,
}

/// Maximum size of a topic that is sorted in memory, bytes.
const MAX_SORTED_BYTES: u64 = 512 << 20;

/// Reads one topic of a recording, in the order of the recorded times.
pub struct TopicReader {
    /// Messages of the recording; those of the topic alone if the recording does not hold them in the order of time.
    messages: Box<dyn Iterator<Item = Result<StoredMessage, String>> + Send>,
    topic: String,
    source: Source,
    /// Time of the first message of the file, ns.
    begin_ns: u64,
    /// Stamp of the recorded run at time zero of the file, ns.
    origin_ns: u64,
    /// Header of a frame whose image follows.
    frame: Option<(u64, yamabico_core::message::FrameHeader)>,
    /// Number of messages read on the topic, and the number and first cause of those left out.
    read: u64,
    refused: u64,
    first_refusal: Option<(u64, Refusal)>,
    broken_off: Option<String>,
}

impl TopicReader {
    /// Opens `topic` of the file or rosbag2 folder `path`, whose messages must be convertible to messages of the type `message`.
    ///
    /// # Errors
    /// The file cannot be read, or has no such topic of a fitting type.
    pub fn open(path: &Path, topic: &str, message: &str) -> Result<TopicReader, RecordingError> {
        let failed = |reason: &dyn std::fmt::Display| RecordingError::File {
            path: path.to_owned(),
            reason: reason.to_string(),
        };
        let open = || Messages::open(path).map_err(|error| failed(&error));
        let (mut begin_ns, mut found, mut known) = (None::<u64>, None, BTreeSet::new());
        let (mut newest_ns, mut is_sorted, mut bytes) = (0, true, 0);
        for read in open()? {
            let read = match read {
                Ok(read) => read,
                // The beginning of a file that breaks off counts.
                Err(_) if begin_ns.is_some() => break,
                Err(error) => return Err(failed(&error)),
            };
            begin_ns = Some(begin_ns.map_or(read.log_time, |begin_ns| begin_ns.min(read.log_time)));
            if !known.contains(&read.topic.name) {
                known.insert(read.topic.name.clone());
            }
            if read.topic.name == topic || read.topic.name == yamabico::image_topic(topic) {
                bytes += read.data.len() as u64;
            }
            if read.topic.name == topic {
                is_sorted &= read.log_time >= newest_ns;
                newest_ns = read.log_time;
                let schema = read.topic.message_type.clone();
                found = Some(match read.topic.encoding.as_str() {
                    "cdr" => Source::Ros2(schema),
                    _ => Source::Yamabico(schema),
                });
            }
        }
        let has: Vec<String> = known.into_iter().filter(|name| !name.ends_with("/scene")).collect();
        let (path_of, name) = (path.to_owned(), topic.to_owned());
        let source = found.ok_or_else(|| RecordingError::NoTopic {
            path: path_of,
            topic: name,
            has: if has.is_empty() { "none".to_owned() } else { has.join(", ") },
        })?;
        let (fits, found) = match &source {
            Source::Yamabico(schema) => (yamabico::fits(schema, message), schema),
            Source::Ros2(schema) => (ros2::fits(schema, message), schema),
        };
        if !fits {
            let expected = ros2::expected(message);
            return Err(RecordingError::Type { topic: topic.to_owned(), found: found.clone(), expected });
        }
        if !is_sorted && bytes > MAX_SORTED_BYTES {
            return Err(failed(&"its messages are not in the order of time, and too many to sort"));
        }
        // Stamps of this program count from the origin of its run.
        let origin_ns = match &source {
            Source::Yamabico(_) => origin(path).map_err(|error| failed(&error))?,
            Source::Ros2(_) => 0,
        };
        let messages: Box<dyn Iterator<Item = _> + Send> = match is_sorted {
            true => Box::new(open()?),
            false => Box::new(sorted(open()?, topic).into_iter()),
        };
        Ok(TopicReader {
            messages,
            topic: topic.to_owned(),
            source,
            begin_ns: begin_ns.unwrap_or(0),
            origin_ns,
            frame: None,
            read: 0,
            refused: 0,
            first_refusal: None,
            broken_off: None,
        })
    }

    /// Returns the name of the message type in the recording.
    #[must_use]
    pub fn message_type(&self) -> &str {
        match &self.source {
            Source::Yamabico(schema) | Source::Ros2(schema) => schema,
        }
    }

    /// Number of messages left out so far, and a description of the first with its number.
    #[must_use]
    pub fn left_out(&self) -> (u64, Option<String>) {
        let first = self.first_refusal.as_ref();
        (
            self.refused,
            first.map(|(number, refusal)| format!("message {number} on {}: {refusal}", self.topic)),
        )
    }

    /// Cause why the file ends early, once it was read to its end.
    #[must_use]
    pub fn broken_off(&self) -> Option<&str> {
        self.broken_off.as_deref()
    }

    /// Converts a message: nothing for one of another topic, or for the header of an image.
    fn convert(&mut self, message: &StoredMessage) -> Option<Recorded> {
        let topic = &message.topic.name;
        if let Some((log_time, header)) = self.frame.take_if(|_| *topic == yamabico::image_topic(&self.topic))
        {
            let stamp_ns = self.on_file_clock(header.stamp_ns);
            let image = yamabico::image(&header, &message.data);
            return self.accept(log_time, stamp_ns, image);
        }
        if *topic != self.topic {
            return None;
        }
        self.read += 1;
        let log_time = message.log_time;
        match &self.source {
            Source::Yamabico(schema) => match yamabico::measurement(schema, &message.data) {
                Ok(Measurement::Frame(header, _)) => {
                    self.frame = Some((log_time, header));
                    None
                }
                converted => {
                    let stamp = converted.as_ref().map_or(0, Measurement::stamp_ns);
                    self.accept(log_time, self.on_file_clock(stamp), converted)
                }
            },
            Source::Ros2(schema) => {
                let converted = ros2::measurement(schema, &message.data);
                let header_ns = converted.as_ref().map_or(0, Measurement::stamp_ns);
                // A header without a stamp, or with one of another clock, is of no use.
                let is_plausible = header_ns <= log_time && log_time - header_ns < ros2::MAX_LATENCY_NS;
                let stamp = if is_plausible { header_ns } else { log_time };
                self.accept(log_time, stamp.saturating_sub(self.begin_ns), converted)
            }
        }
    }

    /// Stamp of a recorded run, ns after the beginning of the file.
    fn on_file_clock(&self, stamp_ns: u64) -> u64 {
        stamp_ns.saturating_sub(self.origin_ns).saturating_sub(self.begin_ns)
    }

    fn accept(
        &mut self,
        log_time: u64,
        stamp_ns: u64,
        converted: Result<Measurement, Refusal>,
    ) -> Option<Recorded> {
        match converted {
            Ok(measurement) => {
                let arrived_ns = log_time.saturating_sub(self.begin_ns);
                Some(Recorded { arrived_ns, stamp_ns: stamp_ns.min(arrived_ns), measurement })
            }
            Err(refusal) => {
                self.refused += 1;
                self.first_refusal.get_or_insert((self.read, refusal));
                None
            }
        }
    }
}

impl Iterator for TopicReader {
    type Item = Recorded;

    fn next(&mut self) -> Option<Recorded> {
        loop {
            match self.messages.next()? {
                Ok(message) => {
                    if let Some(recorded) = self.convert(&message) {
                        return Some(recorded);
                    }
                }
                Err(error) => {
                    self.broken_off = Some(error);
                    return None;
                }
            }
        }
    }
}

/// Messages of a topic and of its images in the order of time, still encoded; last the cause why the recording breaks off.
fn sorted(messages: Messages, topic: &str) -> Vec<Result<StoredMessage, String>> {
    let images = yamabico::image_topic(topic);
    let is_wanted = |message: &StoredMessage| message.topic.name == topic || message.topic.name == images;
    let mut all: Vec<_> = messages.filter(|message| message.as_ref().map_or(true, is_wanted)).collect();
    all.sort_by_key(|message| message.as_ref().map_or(u64::MAX, |message| message.log_time));
    all
}
