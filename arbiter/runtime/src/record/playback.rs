//! Playback of recordings: every message again, in order and byte for byte.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::CompressedImage;
use mcap::io::MessageReader;
use serde_json::Value;
use yamabico_core::message::{Encoding, FrameHeader, Message, MessageType};
use yamabico_core::time::Time;

use super::Tap;
use super::schema::{self, Bytes};
use super::writer::under;

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
    /// Messages that were left out, and why.
    pub left_out: BTreeSet<String>,
    /// Cause why the recording ends early, such as a killed writer or a full disk.
    pub broken_off: Option<String>,
}

/// Passes every message of a recording to `tap`. Losslessly compressed images come back byte for byte, except for the padding
/// between rows; images that the recorder dropped are left out.
///
/// # Errors
/// The file cannot be read or is no recording. A recording that ends early is played up to its end.
pub fn play(path: &Path, tap: &mut dyn Tap) -> Result<PlaybackResult, PlaybackError> {
    play_to(path, tap, None)
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
    play_to(path, tap, Some(frames))
}

fn play_to<'a>(
    path: &Path,
    tap: &'a mut dyn Tap,
    frames: Option<FrameSink<'a>>,
) -> Result<PlaybackResult, PlaybackError> {
    let file =
        File::open(path).map_err(|source| PlaybackError::NotReadable { path: path.to_owned(), source })?;
    let messages = MessageReader::new(BufReader::new(file));
    let mut player = Player { tap, frames, frame: None, played: PlaybackResult::default() };
    let mut has_begun = false;
    for message in messages {
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
    Ok(player.played)
}

struct Player<'a> {
    tap: &'a mut dyn Tap,
    /// Receives frames instead of the tap.
    frames: Option<FrameSink<'a>>,
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
        let Some(schema) =
            message.channel.schema.as_ref().filter(|schema| schema.name.starts_with("yamabico."))
        else {
            return;
        };
        self.miss_image();
        let Some(kind) = MessageType::find(&schema.name) else {
            self.played.left_out.insert(format!("{topic}: {}", MessageType::unknown(&schema.name)));
            return;
        };
        let time = Time(message.log_time);
        let json = serde_json::from_slice::<Value>(&message.data).ok();
        let Some(Bytes { header, items }) = json.and_then(|json| schema::from_json(kind, &json)) else {
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
            self.played.left_out.insert(format!("{}: an image that was not recorded", frame.topic));
        }
    }

    fn show(&mut self, topic: &str, kind: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.played.messages += 1;
        self.tap.message(topic, kind, time, header, items);
    }
}

/// Decompresses the rows of an image, with the stride of the header.
fn pixels(header: &FrameHeader, data: &[u8]) -> Option<Vec<u8>> {
    let image = image::load_from_memory(data).ok()?;
    if (image.width(), image.height()) != (header.width, header.height) {
        return None;
    }
    let encoding = header.encoding()?;
    let packed = match encoding {
        Encoding::Gray8 => image.into_luma8().into_raw(),
        Encoding::Rgb8 => image.into_rgb8().into_raw(),
    };
    let row = header.width as usize * encoding.bytes_per_pixel() as usize;
    let gap = (header.stride as usize).checked_sub(row).filter(|_| row > 0)?;
    if gap == 0 {
        return Some(packed);
    }
    Some(
        packed.chunks(row).flat_map(|line| line.iter().copied().chain(std::iter::repeat_n(0, gap))).collect(),
    )
}
