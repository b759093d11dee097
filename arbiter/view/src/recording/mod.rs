//! A recording: its events and strips as a whole, and the robot's state at any time.

mod chunks;
mod error;
mod player;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::Duration;

use foxglove::Decode;
use foxglove::messages::CompressedImage;
use yamabico_core::message::{
    DecisionHeader, FrameHeader, Goal, Message, MessageType, Mode, Pose, ProcessesHeader, RetuneHeader,
    RobotManifestHeader, Truth, WallsHeader,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::{Bytes, Tap, from_json};

use crate::model::{Event, EventLog, Model, Picture, Strips, header, makes_events};
use chunks::{Chunks, Contents, Entry};
pub use error::RecordingError;
pub use player::Player;

/// Time before an instant from which messages are replayed to show the robot's state at the instant.
const LEAD: Duration = Duration::from_secs(6);
/// Maximum number of rare messages that are kept in memory.
const MAX_RARE: usize = 10_000;

/// An opened recording. Its memory grows with the number of events and, slowly, with its duration; messages and pictures are
/// read from the file when they are needed.
pub struct Recording {
    path: PathBuf,
    chunks: Chunks,
    begin: Time,
    end: Time,
    first_decision: Time,
    events: EventLog,
    strips: Strips,
    rare: VecDeque<Rare>,
    left_out: u64,
}

/// A message that stays in force until the next one of its topic, which may come much later.
struct Rare {
    topic: String,
    message: &'static MessageType,
    time: Time,
    bytes: Bytes,
}

impl Recording {
    /// Opens the file and reads it once, without its pictures.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording. A recording that ends early is read up to its end.
    pub fn open(path: &Path) -> Result<Recording, RecordingError> {
        let mut recording = Recording {
            path: path.to_owned(),
            chunks: Chunks::open(path)?,
            begin: Time::MAX,
            end: Time::ZERO,
            first_decision: Time::MAX,
            events: EventLog::default(),
            strips: Strips::of_everything(),
            rare: VecDeque::new(),
            left_out: 0,
        };
        let (mut pose, mut truth) = (None, None);
        for index in 0..recording.chunks.chunks.len() {
            let mut entries = Vec::new();
            recording.chunks.read(index, &mut |entry| {
                if matches!(entry.channel.contents, Contents::Message(_)) {
                    entries.push(entry.into_owned());
                }
            })?;
            for entry in &entries {
                recording.index(entry, &mut pose, &mut truth);
            }
        }
        if recording.begin == Time::MAX {
            let reason = "it has no message of a robot".to_owned();
            return Err(RecordingError::NoRecording { path: recording.path, reason });
        }
        Ok(recording)
    }

    fn index(&mut self, entry: &Entry<'_>, pose: &mut Option<[f32; 2]>, truth: &mut Option<[f32; 2]>) {
        let Contents::Message(message) = entry.channel.contents else { return };
        self.begin = self.begin.min(entry.time);
        self.end = self.end.max(entry.time);
        let is_rare = is_rare(message);
        let is_needed = is_rare || makes_events(message) || matches!(message.name, Pose::NAME | Truth::NAME);
        if !is_needed {
            return;
        }
        let Some(bytes) = bytes(message, &entry.data) else {
            self.left_out += 1;
            return;
        };
        self.events.message(&entry.channel.topic, message, entry.time, &bytes.header, &bytes.items);
        match message.name {
            Pose::NAME => *pose = header::<Pose>(&bytes.header).map(|pose| [pose.x as f32, pose.y as f32]),
            Truth::NAME => {
                *truth = header::<Truth>(&bytes.header).map(|truth| [truth.x as f32, truth.y as f32]);
            }
            DecisionHeader::NAME => {
                let Some(header) = header::<DecisionHeader>(&bytes.header) else { return };
                self.first_decision = self.first_decision.min(entry.time);
                let stopped = matches!(header.mode(), Some(Mode::EmergencyStop | Mode::CriticalSilent));
                self.strips.decision(entry.time, &header, stopped, *pose, *truth);
            }
            _ => {}
        }
        if is_rare && self.rare.len() < MAX_RARE {
            let (topic, time) = (entry.channel.topic.to_string(), entry.time);
            self.rare.push_back(Rare { topic, message, time, bytes });
        }
    }

    /// File.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Time of the first message.
    pub fn begin(&self) -> Time {
        self.begin
    }

    /// Time of the last message.
    pub fn end(&self) -> Time {
        self.end
    }

    /// Duration, s.
    pub fn duration_s(&self) -> f64 {
        self.end.seconds_after(self.begin)
    }

    /// Events of the whole recording.
    pub fn events(&self) -> impl DoubleEndedIterator<Item = &Event> {
        self.events.events()
    }

    /// Cause why the recording ends early.
    pub fn broken_off(&self) -> Option<&str> {
        self.chunks.broken_off.as_deref()
    }

    /// Number of messages that could not be read.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// State of the robot `at_s` seconds after the first message.
    ///
    /// # Errors
    /// The file cannot be read any more, or has no decision up to then.
    pub fn at(&mut self, at_s: f64) -> Result<Model, RecordingError> {
        let at = self.time(at_s);
        let model = self.state(at)?;
        match model.decision() {
            Some(_) => Ok(model),
            None => Err(RecordingError::NoDecision {
                path: self.path.clone(),
                at_s,
                begin_s: self.first_decision.seconds_after(self.begin).min(self.duration_s()),
                end_s: self.duration_s(),
            }),
        }
    }

    /// Passes every message of the recording to `tap`, without pictures.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn replay(&mut self, tap: &mut dyn Tap) -> Result<(), RecordingError> {
        for index in 0..self.chunks.chunks.len() {
            self.chunks.read(index, &mut |entry| {
                if let Contents::Message(message) = entry.channel.contents
                    && let Some(Bytes { header, items }) = bytes(message, &entry.data)
                {
                    tap.message(&entry.channel.topic, message, entry.time, &header, &items);
                }
            })?;
        }
        Ok(())
    }

    /// Instant `at_s` seconds after the first message, within the recording.
    pub(crate) fn time(&self, at_s: f64) -> Time {
        let at_s = if at_s.is_finite() { at_s.clamp(0.0, self.duration_s()) } else { 0.0 };
        self.begin + Duration::from_secs_f64(at_s)
    }

    /// State at `at`, without a decision if there was none in the six seconds before.
    fn state(&mut self, at: Time) -> Result<Model, RecordingError> {
        let mut model = Model::of_recording(self.begin, at, self.strips.until(at));
        for (_, text) in &self.chunks.attachments {
            model.add_file(text);
        }
        for rare in self.rare.iter().filter(|rare| rare.time <= at) {
            model.message(&rare.topic, rare.message, rare.time, &rare.bytes.header, &rare.bytes.items);
        }
        let from = at - LEAD;
        let first = self.chunks.chunks.partition_point(|chunk| chunk.end < from);
        for index in first..self.chunks.chunks.len() {
            let mut is_over = false;
            self.chunks.read(index, &mut |entry| {
                is_over |= entry.time > at;
                if (from..=at).contains(&entry.time) {
                    show(&mut model, &entry);
                }
            })?;
            if is_over {
                break;
            }
        }
        Ok(model)
    }
}

/// Passes an entry of a recording to `model`.
fn show(model: &mut Model, entry: &Entry<'_>) {
    match &entry.channel.contents {
        Contents::Message(message) => {
            if let Some(Bytes { header, items }) = bytes(message, &entry.data) {
                model.message(&entry.channel.topic, message, entry.time, &header, &items);
            }
        }
        Contents::Pictures(camera) => {
            let Some(image) = CompressedImage::decode(&entry.data[..]).ok() else { return };
            let media_type = match image.format.as_str() {
                "png" => "image/png",
                _ => "image/jpeg",
            };
            // Its stamp is on the clock of the recording, those of the bus are on the clock of the run.
            let stamp_ns = image.timestamp.map_or(entry.time.0, |stamp| {
                let since_ns = u64::from(stamp.sec()) * 1_000_000_000 + u64::from(stamp.nsec());
                entry.origin.0.saturating_add(since_ns)
            });
            let (width, height) = size(&image.data).unwrap_or((0, 0));
            let header = FrameHeader { stamp_ns, width, height, ..FrameHeader::default() };
            model.picture(camera, Picture { header, media_type, data: image.data.to_vec().into() });
        }
    }
}

/// Width and height of a compressed picture.
fn size(data: &[u8]) -> Option<(u32, u32)> {
    let reader = image::ImageReader::new(std::io::Cursor::new(data)).with_guessed_format().ok()?;
    reader.into_dimensions().ok()
}

fn bytes(message: &MessageType, data: &[u8]) -> Option<Bytes> {
    from_json(message, &serde_json::from_slice(data).ok()?)
}

/// Returns true if a message of this type stays in force for a long time.
fn is_rare(message: &MessageType) -> bool {
    matches!(
        message.name,
        RobotManifestHeader::NAME
            | WallsHeader::NAME
            | ProcessesHeader::NAME
            | Goal::NAME
            | RetuneHeader::NAME
    )
}
