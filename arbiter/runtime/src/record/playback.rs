//! Playback of recordings: every message again, in order and byte for byte.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::CompressedImage;
use image::ImageReader;
use yamabico_core::message::{Encoding, FrameHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_mcap::{Channel, MessagesAhead, ReadError};

use super::Tap;
use super::channels::under;
use super::contents::{BROKE_OFF, Contents};
use super::json_reader;
use super::schema::{self, Bytes};

/// Maximum size of an image, bytes; a larger one is left out.
const MAX_PIXEL_BYTES: usize = 128 << 20;

/// Failure of a playback.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The file cannot be opened.
    #[error("recording {} cannot be opened: {source}", path.display())]
    NotReadable {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is not a recording.
    #[error("{} is not an MCAP recording: {reason}", path.display())]
    NoRecording {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

impl PlaybackError {
    /// Failure to read the recording `path`.
    pub(super) fn new(path: &Path, error: ReadError) -> PlaybackError {
        let path = path.to_owned();
        match error {
            ReadError::Io(source) => PlaybackError::NotReadable { path, source },
            error => PlaybackError::NoRecording { path, reason: error.to_string() },
        }
    }
}

/// Passes every readable message of the wanted channels of a file to `each`; returns the cause why the file breaks off, if it does.
///
/// # Errors
/// The file cannot be read up to its first message, or `each` fails.
pub(super) fn each_message<E: From<PlaybackError>>(
    path: &Path,
    is_wanted: impl Fn(&Channel) -> bool,
    mut each: impl FnMut(&yamabico_mcap::Message<'_>) -> Result<(), E>,
) -> Result<Option<String>, E> {
    let failed = |error| PlaybackError::new(path, error);
    let (mut messages, mut has_begun) = (MessagesAhead::open(path, is_wanted).map_err(failed)?, false);
    loop {
        match messages.next() {
            Ok(Some(message)) => each(&message)?,
            Ok(None) => return Ok(None),
            Err(error) if has_begun => return Ok(Some(error.to_string())),
            Err(error) => return Err(failed(error).into()),
        }
        has_begun = true;
    }
}

/// Result of a playback.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlaybackResult {
    /// Number of messages passed to the tap.
    pub messages: u64,
    /// Number of images that the recorder dropped, since its writer was behind.
    pub images_missing: u64,
    /// Messages that were left out, and why.
    pub left_out: BTreeSet<String>,
    /// Cause why the recording ends early, such as a killed writer or a full disk.
    pub broken_off: Option<String>,
}

impl PlaybackResult {
    /// Notes on missing parts, for people.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let images =
            (self.images_missing > 0).then(|| format!("{} images were not recorded", self.images_missing));
        let left_out = self.left_out.iter().map(|what| format!("left out: {what}"));
        let broken_off = self.broken_off.iter().map(|cause| format!("the recording breaks off: {cause}"));
        images.into_iter().chain(left_out).chain(broken_off).collect()
    }
}

/// Passes every message of a recording to `tap`, with the times of its run. Losslessly compressed images come back byte for byte, except for the padding
/// between rows; images that the recorder dropped are left out.
///
/// # Errors
/// The file cannot be read or is no recording. A recording that ends early is played up to its end.
pub fn play(path: &Path, tap: &mut dyn Tap) -> Result<PlaybackResult, PlaybackError> {
    play_to(path, tap, Pictures::Decoded, &|_| true)
}

/// Same as [`play`], but passes on the messages of some topics only.
///
/// # Errors
/// Same as [`play`].
pub fn play_topics(
    path: &Path,
    tap: &mut dyn Tap,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Result<PlaybackResult, PlaybackError> {
    play_to(path, tap, Pictures::Decoded, is_wanted)
}

/// Same as [`play_topics`], but frames come without pixels.
///
/// # Errors
/// Same as [`play`].
pub(crate) fn play_headers(
    path: &Path,
    tap: &mut dyn Tap,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Result<PlaybackResult, PlaybackError> {
    play_to(path, tap, Pictures::LeftOut, is_wanted)
}

/// Receives a frame whose image is still compressed: topic, header, image file.
pub(crate) type FrameSink<'a> = &'a mut dyn FnMut(&str, &FrameHeader, &[u8]);

/// Same as [`play`], but passes frames to `frames`, without decompressing them.
///
/// # Errors
/// Same as [`play`].
pub(crate) fn play_compressed(
    path: &Path,
    tap: &mut dyn Tap,
    frames: FrameSink<'_>,
) -> Result<PlaybackResult, PlaybackError> {
    play_to(path, tap, Pictures::Compressed(frames), &|_| true)
}

/// Pictures of a playback.
enum Pictures<'a> {
    /// As pixels behind the headers of their frames.
    Decoded,
    /// As they are, with the headers of their frames.
    Compressed(FrameSink<'a>),
    /// None: the headers of their frames alone.
    LeftOut,
}

fn play_to<'a>(
    path: &Path,
    tap: &'a mut dyn Tap,
    pictures: Pictures<'a>,
    is_wanted: &'a dyn Fn(&str) -> bool,
) -> Result<PlaybackResult, PlaybackError> {
    let contents = Contents::read(path)?;
    let origin = contents.origin();
    let kinds = BTreeMap::new();
    let played = PlaybackResult::default();
    let has_pictures = !matches!(pictures, Pictures::LeftOut);
    let is_needed = |channel: &Channel| match pictured(&channel.topic) {
        Some(topic) if !is_json(channel) => has_pictures && is_wanted(topic),
        _ => is_json(channel) && is_wanted(&channel.topic),
    };
    let mut player = Player { tap, pictures, origin, kinds, frame: None, played };
    let broken_off = each_message(path, is_needed, |message| {
        player.take(message);
        Ok::<(), PlaybackError>(())
    })?;
    player.miss_image();
    let mut played = player.played;
    // A repaired file has an end, and still not the end of its run.
    played.broken_off = broken_off.or_else(|| contents.facts.get(BROKE_OFF).cloned());
    Ok(played)
}

/// Returns true for a channel with messages of the bus.
fn is_json(channel: &Channel) -> bool {
    channel.schema.as_ref().is_some_and(|schema| schema.encoding == "jsonschema")
}

/// Topic of the frames whose pictures a channel on this topic holds, if it does.
fn pictured(topic: &str) -> Option<&str> {
    topic.strip_prefix('/')?.strip_suffix("/image")
}

struct Player<'a> {
    tap: &'a mut dyn Tap,
    /// Stamp at time zero of the recording.
    origin: Time,
    pictures: Pictures<'a>,
    /// Contents of the channels, by their numbers.
    kinds: BTreeMap<u16, Kind>,
    /// Frame whose image follows.
    frame: Option<Frame>,
    played: PlaybackResult,
}

/// Contents of a channel.
#[derive(Clone, Copy)]
enum Kind {
    /// Messages of the bus.
    Message(&'static MessageType),
    /// Messages of the bus, of an unknown type.
    Unknown,
    /// Something else, such as images.
    Other,
}

struct Frame {
    topic: String,
    time: Time,
    header: FrameHeader,
}

impl Player<'_> {
    fn take(&mut self, message: &yamabico_mcap::Message<'_>) {
        let topic = &message.channel.topic;
        if self.frame.as_ref().is_some_and(|frame| under(&frame.topic, "image") == *topic) {
            return self.take_image(message.data);
        }
        let kind = match self.kind(message.channel) {
            Kind::Message(kind) => kind,
            Kind::Unknown => return self.miss_image(),
            Kind::Other => return,
        };
        self.miss_image();
        let time = Time(self.origin.0.saturating_add(message.log_time));
        let Some(Bytes { header, items }) = json_reader::read(kind, message.data) else {
            self.played.left_out.insert(format!("{topic}: a message that is not a {}", kind.name));
            return;
        };
        match bytemuck::try_pod_read_unaligned(&header) {
            Ok(header) if kind.name == FrameHeader::NAME && !matches!(self.pictures, Pictures::LeftOut) => {
                self.frame = Some(Frame { topic: topic.clone(), time, header });
            }
            _ => self.show(topic, kind, time, &header, &items),
        }
    }

    fn kind(&mut self, channel: &Channel) -> Kind {
        if let Some(kind) = self.kinds.get(&channel.id) {
            return *kind;
        }
        let schema = channel.schema.as_ref().filter(|_| is_json(channel));
        let kind = match schema.and_then(|schema| schema::message_type(&schema.name, &schema.data)) {
            None => Kind::Other,
            Some(Ok(kind)) => Kind::Message(kind),
            Some(Err(problem)) => {
                self.played.left_out.insert(format!("{}: {problem}", channel.topic));
                Kind::Unknown
            }
        };
        self.kinds.insert(channel.id, kind);
        kind
    }

    fn take_image(&mut self, data: &[u8]) {
        let Some(Frame { topic, time, header }) = self.frame.take() else { return };
        if let Pictures::Compressed(frames) = &mut self.pictures {
            match CompressedImage::decode(data) {
                Ok(image) => frames(&topic, &header, &image.data),
                Err(_) => drop(self.played.left_out.insert(format!("{topic}: an image that cannot be read"))),
            }
            return;
        }
        match CompressedImage::decode(data).ok().and_then(|image| pixels(&header, &image.data)) {
            Some(pixels) => {
                let kind = MessageType::of::<FrameHeader>();
                self.show(&topic, &kind, time, bytemuck::bytes_of(&header), &pixels);
            }
            None => drop(self.played.left_out.insert(format!("{topic}: an image that cannot be decoded"))),
        }
    }

    /// Notes that the pending frame has no image.
    fn miss_image(&mut self) {
        if let Some(frame) = self.frame.take() {
            self.played.images_missing += 1;
            self.played.left_out.insert(format!("{}: an image that was not recorded", frame.topic));
        }
    }

    fn show(&mut self, topic: &str, kind: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.played.messages += 1;
        self.tap.message(topic, kind, time, header, items);
    }
}

/// Decompresses the rows of an image, with the stride of the header; `None` if they contradict each other.
fn pixels(header: &FrameHeader, data: &[u8]) -> Option<Vec<u8>> {
    let encoding = header.encoding()?;
    let row = (header.width as usize).checked_mul(encoding.bytes_per_pixel() as usize)?;
    let stride = header.stride as usize;
    let size = stride.checked_mul(header.height as usize)?;
    if row == 0 || stride < row || size > MAX_PIXEL_BYTES {
        return None;
    }
    // Checked before memory is reserved for the pixels.
    let reader = || ImageReader::new(Cursor::new(data)).with_guessed_format().ok();
    if reader()?.into_dimensions().ok()? != (header.width, header.height) {
        return None;
    }
    let image = reader()?.decode().ok()?;
    let packed = match encoding {
        Encoding::Gray8 => image.into_luma8().into_raw(),
        Encoding::Rgb8 => image.into_rgb8().into_raw(),
    };
    if stride == row {
        return Some(packed);
    }
    let mut padded = vec![0; size];
    for (line, packed) in padded.chunks_exact_mut(stride).zip(packed.chunks_exact(row)) {
        line[..row].copy_from_slice(packed);
    }
    Some(padded)
}
