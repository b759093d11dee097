//! Playback of recordings: every message again, in order and byte for byte.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::CompressedImage;
use image::ImageReader;
use mcap::io::MessageReader;
use yamabico_core::message::{Encoding, FrameHeader, Message, MessageType};
use yamabico_core::time::Time;

use super::Tap;
use super::channels::under;
use super::contents::{BROKE_OFF, Contents, missing_end, reader_options};
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
    play_to(path, tap, None, &|_| true)
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
    play_to(path, tap, None, is_wanted)
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
    play_to(path, tap, Some(frames), &|_| true)
}

fn play_to<'a>(
    path: &Path,
    tap: &'a mut dyn Tap,
    frames: Option<FrameSink<'a>>,
    is_wanted: &'a dyn Fn(&str) -> bool,
) -> Result<PlaybackResult, PlaybackError> {
    let contents = Contents::read(path)?;
    let origin = contents.origin();
    let file =
        File::open(path).map_err(|source| PlaybackError::NotReadable { path: path.to_owned(), source })?;
    let mut messages = MessageReader::new_with_options(BufReader::new(file), reader_options());
    let mut player =
        Player { tap, frames, is_wanted, origin, frame: None, played: PlaybackResult::default() };
    let mut has_begun = false;
    for message in &mut messages {
        match message {
            Ok(message) => player.take(&message),
            Err(error) if has_begun => {
                player.played.broken_off = Some(error.to_string());
                break;
            }
            Err(error) => {
                let reason = error.to_string();
                return Err(PlaybackError::NoRecording { path: path.to_owned(), reason });
            }
        }
        has_begun = true;
    }
    player.miss_image();
    let mut played = player.played;
    if played.broken_off.is_none() {
        // A repaired file has an end, and still not the end of its run.
        let missing = missing_end(&mut messages.into_inner());
        played.broken_off = missing.or_else(|| contents.facts.get(BROKE_OFF).cloned());
    }
    Ok(played)
}

struct Player<'a> {
    tap: &'a mut dyn Tap,
    /// Stamp at time zero of the recording.
    origin: Time,
    /// Receives frames instead of the tap.
    frames: Option<FrameSink<'a>>,
    /// Selects the topics.
    is_wanted: &'a dyn Fn(&str) -> bool,
    /// Frame whose image follows.
    frame: Option<Frame>,
    played: PlaybackResult,
}

struct Frame {
    topic: String,
    time: Time,
    header: FrameHeader,
}

impl Player<'_> {
    fn take(&mut self, message: &mcap::Message<'_>) {
        let topic = &message.channel.topic;
        if self.frame.as_ref().is_some_and(|frame| under(&frame.topic, "image") == *topic) {
            return self.take_image(&message.data);
        }
        let schema = message.channel.schema.as_ref().filter(|schema| schema.encoding == "jsonschema");
        let Some(kind) = schema.and_then(|schema| schema::message_type(&schema.name, &schema.data)) else {
            return;
        };
        self.miss_image();
        if !(self.is_wanted)(topic) {
            return;
        }
        let kind = match kind {
            Ok(kind) => kind,
            Err(problem) => {
                self.played.left_out.insert(format!("{topic}: {problem}"));
                return;
            }
        };
        let time = Time(self.origin.0.saturating_add(message.log_time));
        let Some(Bytes { header, items }) = json_reader::read(kind, &message.data) else {
            self.played.left_out.insert(format!("{topic}: a message that is not a {}", kind.name));
            return;
        };
        match bytemuck::try_pod_read_unaligned(&header) {
            Ok(header) if kind.name == FrameHeader::NAME => {
                self.frame = Some(Frame { topic: topic.clone(), time, header });
            }
            _ => self.show(topic, kind, time, &header, &items),
        }
    }

    fn take_image(&mut self, data: &[u8]) {
        let Some(Frame { topic, time, header }) = self.frame.take() else { return };
        if let Some(frames) = &mut self.frames {
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
