//! A run as an MCAP file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;

use foxglove::{Context, McapAttachment, McapCompression, McapWriteOptions, McapWriterHandle};
use yamabico_core::message::{FrameHeader, Message, MessageType};
use yamabico_core::sensor::{Robot, SensorInfo};
use yamabico_core::time::Time;

use super::file::{Failure, OutputFile};
use super::queue::{Entry, Queue};
use super::writer::Writer;
use super::{ImageFormat, RecordError, Tap};

/// Bytes of messages that are compressed together; what a crash can lose.
const CHUNK_BYTES: u64 = 1 << 20;

/// What happens while the writer is slower than the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The run waits: nothing is lost.
    Lockstep,
    /// The run never waits: pictures are left out, and in the worst case messages; both are counted.
    Live,
}

/// What is to be recorded, and where.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file; one that is there is replaced.
    pub path: PathBuf,
    /// Whether the run may wait for the writer.
    pub pace: Pace,
    /// How pictures are compressed.
    pub images: ImageFormat,
    /// The robot, for its outline.
    pub robot: Robot,
    /// Sensors by topic, for where they sit.
    pub sensors: Vec<(String, SensorInfo)>,
    /// Texts to attach, by name: the task file and the robot file.
    pub files: Vec<(String, String)>,
    /// What is known before the run: overrides, seed, version.
    pub facts: BTreeMap<String, String>,
}

impl Recording {
    /// A lossless recording to `path` at the pace of `pace`, with nothing attached.
    pub fn new(path: impl Into<PathBuf>, pace: Pace) -> Recording {
        Recording {
            path: path.into(),
            pace,
            images: ImageFormat::Png,
            robot: Robot::default(),
            sensors: Vec::new(),
            files: Vec::new(),
            facts: BTreeMap::new(),
        }
    }
}

/// How a recording ended.
#[derive(Debug)]
pub struct Recorded {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Messages written on each topic of the bus; where it broke off, a last chunk of them never reached the file.
    pub messages: BTreeMap<String, u64>,
    /// Pictures left out because the writer was behind; their headers were written.
    pub pictures_dropped: u64,
    /// Messages left out because the writer was far behind, or because it had failed.
    pub messages_dropped: u64,
    /// Why it broke off, where it did.
    pub error: Option<RecordError>,
}

/// Writes every message of a run to an MCAP file, on a thread of its own.
///
/// A message `T` is there as JSON under its own topic, and, where Foxglove has a schema for it, once more under
/// `/T/image`, `/T/scan`, `/T/pose` and `/T/scene`; `/tf` holds the coordinate frames, `/log` what changed, in words.
/// A failure (a full disk) is logged once; the run goes on, and [`McapRecorder::finish`] tells it.
pub struct McapRecorder {
    path: PathBuf,
    pace: Pace,
    queue: Queue,
    failure: Failure,
    topics: BTreeMap<String, Arc<str>>,
    pictures_dropped: u64,
    messages_offered: u64,
    handle: Option<McapWriterHandle<OutputFile>>,
    thread: Option<JoinHandle<BTreeMap<String, u64>>>,
    // Channels live as long as their context.
    _context: Arc<Context>,
}

impl McapRecorder {
    /// Opens the file and starts the thread that writes.
    ///
    /// # Errors
    /// The folder is missing, the path is a folder, or the file cannot be written.
    pub fn create(recording: Recording) -> Result<McapRecorder, RecordError> {
        let path = recording.path;
        let file = OutputFile::create(&path)?;
        let failure = file.failure();
        let context = Context::new();
        let options = McapWriteOptions::new()
            .compression(Some(McapCompression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .profile("")
            .disable_seeking(true);
        let handle = context.mcap_writer_with_options(options).create(file);
        let handle = handle.map_err(|error| writer_error(&path, error))?;
        attach(&handle, &recording.files).map_err(|error| writer_error(&path, error))?;
        handle.write_metadata("run", recording.facts).map_err(|error| writer_error(&path, error))?;

        let queue = Queue::default();
        let mut writer = Writer::new(context.clone(), recording.images, &recording.robot);
        let (waiting, sensors, broken) = (queue.clone(), recording.sensors, failure.clone());
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || {
            let _closing = Closing(&waiting);
            writer.begin(&sensors);
            writer.run(&waiting, || broken.has_happened())
        });
        let thread = thread.map_err(|error| writer_error(&path, error))?;
        Ok(McapRecorder {
            path,
            pace: recording.pace,
            queue,
            failure,
            topics: BTreeMap::new(),
            pictures_dropped: 0,
            messages_offered: 0,
            handle: Some(handle),
            thread: Some(thread),
            _context: context,
        })
    }

    /// Whether the recording has broken off.
    pub fn has_failed(&self) -> bool {
        self.failure.has_happened()
    }

    /// Writes what still waits, adds what is known after the run (its digest) and closes the file.
    pub fn finish(mut self, facts: BTreeMap<String, String>) -> Recorded {
        self.queue.end();
        let mut error = None;
        let messages = match self.thread.take().map(JoinHandle::join) {
            Some(Ok(counts)) => counts,
            Some(Err(panic)) => {
                error = Some(writer_error(&self.path, panic_words(&*panic)));
                BTreeMap::new()
            }
            None => BTreeMap::new(),
        };
        if let Some(handle) = self.handle.take() {
            let closed = handle.write_metadata("result", facts).and_then(|()| handle.close());
            let flushed = closed.map(|mut file| std::io::Write::flush(&mut file));
            if let Err(reason) = flushed {
                error.get_or_insert(writer_error(&self.path, reason));
            }
        }
        Recorded {
            bytes: self.failure.bytes(),
            pictures_dropped: self.pictures_dropped,
            messages_dropped: self.messages_offered - messages.values().sum::<u64>(),
            messages,
            error: self.failure.take().or(error),
            path: std::mem::take(&mut self.path),
        }
    }
}

impl Tap for McapRecorder {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let name = match self.topics.get(topic) {
            Some(name) => name.clone(),
            None => self.topics.entry(topic.to_owned()).or_insert(topic.into()).clone(),
        };
        let mut entry = Entry { topic: &name, message, time, header, items };
        self.messages_offered += 1;
        match self.pace {
            Pace::Lockstep => self.queue.wait(&entry),
            Pace::Live => {
                if message.name == FrameHeader::NAME && !self.queue.has_room_for(items.len()) {
                    self.pictures_dropped += 1;
                    entry.items = &[];
                }
                self.queue.offer(&entry)
            }
        };
    }
}

impl Drop for McapRecorder {
    /// A recorder that is dropped without [`McapRecorder::finish`] still closes its file.
    fn drop(&mut self) {
        self.queue.end();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Closes the queue when the writer ends, however it ends, so that nobody waits for it.
struct Closing<'a>(&'a Queue);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.close();
    }
}

fn attach(
    handle: &McapWriterHandle<OutputFile>,
    files: &[(String, String)],
) -> Result<(), foxglove::FoxgloveError> {
    for (name, text) in files {
        handle.attach(&McapAttachment {
            log_time: 0,
            create_time: 0,
            name: name.clone(),
            media_type: "application/toml".to_owned(),
            data: text.as_bytes().into(),
        })?;
    }
    Ok(())
}

fn writer_error(path: &Path, reason: impl ToString) -> RecordError {
    RecordError::Writer { path: path.to_owned(), reason: reason.to_string() }
}

fn panic_words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("a panic without words").to_owned()
}
