//! Recording of a run: every message in order, as a digest and as a file.
//!
//! A [`Tap`] receives each message once, in the order of the run. [`Digest`] condenses them to one number, equal for equal
//! runs; [`McapRecorder`] writes them to a file that Foxglove, Lichtblick and the Python package `mcap` open; [`play`] reads the
//! file and passes its messages to a tap again.

mod calibration;
mod channels;
mod code_text;
mod contents;
mod control_log;
mod digest;
mod encoder;
mod error;
mod facts;
mod file;
mod frames;
mod identity;
mod images;
mod incoming;
mod info;
mod json_reader;
mod map_lines;
mod mcap;
mod overlays;
mod playback;
mod queue;
mod ranges;
mod repair;
mod run_file;
mod run_folder;
mod runs;
mod scene;
mod schema;
mod surroundings;
mod utc;
mod writer;

pub use channels::{Channel, Format, Records, channels, is_lasting};
pub use contents::Contents;

pub use digest::Digest;
pub use encoder::{Encoder, RobotSetup};
pub use error::RecordError;
pub use facts::{RecordedFacts, read_facts};
pub(crate) use identity::digest_of_program;
pub use identity::{Execution, Identity, RecordedIdentity};
pub use images::{ImageFormat, compress};
pub use info::{Info, InfoCounter, TopicInfo, info};
pub use map_lines::map_lines;
pub use mcap::{McapRecorder, Pace, Recording, RecordingResult};
pub use playback::{PlaybackError, PlaybackResult, play, play_topics};
pub(crate) use playback::{play_compressed, play_headers};
pub use repair::{RepairError, Repaired, repair};
pub use run_folder::RunFolder;
pub use runs::runs;
pub use schema::{Bytes, from_json, to_json};
pub use utc::utc;

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

/// Beginning of the topics with the messages of a what-if.
pub const WHAT_IF: &str = "/what-if/";

/// Receives every message of a run, in the order of the run.
pub trait Tap {
    /// Receives a message on `topic`, published at `time`: the bytes of its header and of the items after it.
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]);
}

/// Passes every message to each of several taps.
#[derive(Default)]
pub struct Tee<'a>(pub Vec<&'a mut dyn Tap>);

impl Tap for Tee<'_> {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        for tap in &mut self.0 {
            tap.message(topic, message, time, header, items);
        }
    }
}
