//! What a run leaves behind: every message in order, as a digest and as a recording.
//!
//! A [`Tap`] is shown each message once, in the order of the run. [`Digest`] condenses them to one number that two equal
//! runs share; [`McapRecorder`] writes them to a file that Foxglove, Lichtblick and the Python package `mcap` open, and [`play`]
//! shows them again.

mod digest;
mod error;
mod file;
mod frames;
mod images;
mod mcap;
mod playback;
mod queue;
mod ranges;
mod scene;
mod schema;
mod words;
mod writer;

pub use digest::Digest;
pub use error::RecordError;
pub use images::ImageFormat;
pub use mcap::{McapRecorder, Pace, Recorded, Recording};
pub use playback::{PlaybackError, Played, play};
pub use schema::to_json;

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

/// Is shown every message of a run, in the order of the run.
pub trait Tap {
    /// One message on `topic`, published at `time`: the bytes of its header and of the items behind it.
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]);
}

/// Shows every message to each of several taps.
#[derive(Default)]
pub struct Tee<'a>(pub Vec<&'a mut dyn Tap>);

impl Tap for Tee<'_> {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        for tap in &mut self.0 {
            tap.message(topic, message, time, header, items);
        }
    }
}
