//! Recording of a run as an MCAP file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::SystemTime;

use foxglove::{Context, McapAttachment, McapCompression, McapWriteOptions, McapWriterHandle};
use yamabico_core::message::{FrameHeader, Message, MessageType};
use yamabico_core::sensor::{Robot, SensorInfo};
use yamabico_core::time::Time;

use super::encoder::{Encoder, RobotSetup};
use super::file::{Failure, OutputFile};
use super::queue::{Entry, Queue};
use super::run_file::{Handle, RunFile};
use super::writer::Writer;
use super::{ImageFormat, RecordError, Tap, map_lines};

/// Size of a compressed chunk, bytes.
const CHUNK_BYTES: u64 = 1 << 20;

/// Behavior of a recording while its writer is slower than the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The run waits: nothing is dropped.
    Lockstep,
    /// The run never waits: images are dropped, and in the worst case messages; both are counted.
    Live,
}

/// Contents and destination of a recording.
#[derive(Clone, Debug)]
pub struct Recording {
    /// File.
    pub path: PathBuf,
    /// If set, an existing file is replaced; otherwise it is refused.
    pub replaces: bool,
    /// Pace of the run.
    pub pace: Pace,
    /// Compression of images.
    pub images: ImageFormat,
    /// The robot, for its outline.
    pub robot: Robot,
    /// Sensors by topic, for their mounts.
    pub sensors: Vec<(String, SensorInfo)>,
    /// Texts to attach, by name: the task file, the robot file, and the files that they name.
    pub files: Vec<(String, String)>,
    /// Facts known before the run: its [`Identity`](super::Identity).
    pub facts: BTreeMap<String, String>,
}

impl Recording {
    /// A lossless recording to `path` without attachments.
    pub fn new(path: impl Into<PathBuf>, pace: Pace) -> Recording {
        Recording {
            path: path.into(),
            replaces: false,
            pace,
            images: ImageFormat::Png,
            robot: Robot::default(),
            sensors: Vec::new(),
            files: Vec::new(),
            facts: BTreeMap::new(),
        }
    }
}

/// Result of a recording.
#[derive(Debug)]
pub struct RecordingResult {
    /// File.
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// Number of messages written on each topic of the bus; if writing failed, the last chunk of them is not in the file.
    pub messages: BTreeMap<String, u64>,
    /// Number of images dropped because the writer was behind; their headers were written.
    pub images_dropped: u64,
    /// Number of messages dropped because the writer was far behind or had failed.
    pub messages_dropped: u64,
    /// Failure that ended the recording early.
    pub error: Option<RecordError>,
}

/// Writes every message of a run to an MCAP file, on a thread of its own.
///
/// The records are those of an [`Encoder`]. Times count from the first message; the record `run` says when that was. A failure,
/// such as a full disk, is logged once; the run goes on, and [`McapRecorder::finish`] reports it.
pub struct McapRecorder {
    path: PathBuf,
    pace: Pace,
    queue: Queue,
    failure: Failure,
    topics: BTreeMap<String, Arc<str>>,
    images_dropped: u64,
    messages_offered: u64,
    started: Arc<OnceLock<SystemTime>>,
    handle: Option<Handle>,
    thread: Option<JoinHandle<BTreeMap<String, u64>>>,
    // Channels live only as long as their context.
    _context: Arc<Context>,
}

impl McapRecorder {
    /// Opens the file and starts the writer's thread.
    ///
    /// # Errors
    /// The folder is missing, the path is a folder, the file exists or cannot be written.
    pub fn create(recording: Recording) -> Result<McapRecorder, RecordError> {
        let path = recording.path;
        let file = OutputFile::create(&path, recording.replaces)?;
        let failure = file.failure();
        let context = Context::new();
        let options = McapWriteOptions::new()
            .compression(Some(McapCompression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .profile("")
            .disable_seeking(true);
        let handle = context.mcap_writer_with_options(options).create(file);
        let handle = Arc::new(handle.map_err(|error| writer_error(&path, error))?);
        attach(&handle, &recording.files).map_err(|error| writer_error(&path, error))?;

        let (queue, started) = (Queue::default(), Arc::<OnceLock<SystemTime>>::default());
        let mut file = RunFile::new(handle.clone(), recording.facts, started.clone());
        let setup = RobotSetup {
            radius_m: recording.robot.radius_m,
            sensors: recording.sensors,
            map: recording.files.iter().flat_map(|(_, text)| lines_of(text)).collect(),
        };
        let writer = Writer::new(context.clone(), Encoder::new(setup, recording.images));
        let (waiting, broken) = (queue.clone(), failure.clone());
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || {
            let _closing = Closing(&waiting);
            writer.run(&waiting, &mut file, || broken.has_happened())
        });
        let thread = thread.map_err(|error| writer_error(&path, error))?;
        Ok(McapRecorder {
            path,
            pace: recording.pace,
            queue,
            failure,
            topics: BTreeMap::new(),
            images_dropped: 0,
            messages_offered: 0,
            started,
            handle: Some(handle),
            thread: Some(thread),
            _context: context,
        })
    }

    /// Returns true if writing has failed.
    pub fn has_failed(&self) -> bool {
        self.failure.has_happened()
    }

    /// Writes the remaining messages, adds facts known after the run (its digest) and closes the file.
    pub fn finish(mut self, facts: BTreeMap<String, String>) -> RecordingResult {
        self.queue.end();
        let mut error = None;
        let messages = match self.thread.take().map(JoinHandle::join) {
            Some(Ok(counts)) => counts,
            Some(Err(panic)) => {
                error = Some(writer_error(&self.path, panic_text(&*panic)));
                BTreeMap::new()
            }
            None => BTreeMap::new(),
        };
        // The thread has dropped its share, unless it never ended.
        if let Some(handle) = self.handle.take().and_then(Arc::into_inner) {
            let closed = handle.write_metadata("result", facts).and_then(|()| handle.close());
            let flushed = closed.map(|mut file| std::io::Write::flush(&mut file));
            if let Err(reason) = flushed {
                error.get_or_insert(writer_error(&self.path, reason));
            }
        }
        RecordingResult {
            bytes: self.failure.bytes(),
            images_dropped: self.images_dropped,
            messages_dropped: self.messages_offered - messages.values().sum::<u64>(),
            messages,
            error: self.failure.take().or(error),
            path: std::mem::take(&mut self.path),
        }
    }
}

impl Tap for McapRecorder {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.started.get_or_init(SystemTime::now);
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
                    self.images_dropped += 1;
                    entry.items = &[];
                }
                self.queue.offer(&entry)
            }
        };
    }
}

impl Drop for McapRecorder {
    /// Closes the file of a recorder that is dropped without [`McapRecorder::finish`].
    fn drop(&mut self) {
        self.queue.end();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Closes the queue when the writer ends, however it ends, so that the run does not wait for it.
struct Closing<'a>(&'a Queue);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// Lines of a map file; none of another file.
fn lines_of(file: &str) -> Vec<[[f64; 2]; 2]> {
    file.parse().map_or_else(|_| Vec::new(), |table| map_lines(&table))
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

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("a panic without a message").to_owned()
}
