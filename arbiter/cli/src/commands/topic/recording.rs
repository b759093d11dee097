//! `yamabico topic` on a recording.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_parameters::instead;
use yamabico_runtime::record::{PlaybackError, Tap, info, play_topics};

use super::echo::message_text;
use crate::output::{CommandResult, DONE, Failure, Print, complain, printable, table};

/// A recording in place of a running robot.
#[derive(Args)]
pub struct RecordingArgument {
    /// Recording to read, in place of a running robot.
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "robot")]
    pub recording: Option<PathBuf>,
}

/// A topic of a recording.
#[derive(Serialize)]
struct Recorded {
    name: String,
    message: String,
    messages: u64,
    rate_hz: Option<f64>,
    largest_gap_s: f64,
}

/// Lists the topics of a recording that hold messages of this program.
pub fn list(file: &Path, print: Print) -> CommandResult {
    print.show(&topics(file)?, |topics| {
        let mut rows = table(&["topic", "message", "messages", "rate", "largest gap"], 2..5);
        for topic in topics {
            rows.add_row([
                topic.name.clone(),
                topic.message.clone(),
                topic.messages.to_string(),
                topic.rate_hz.map_or("-".into(), |rate| format!("{rate:.1} Hz")),
                format!("{:.2} s", topic.largest_gap_s),
            ]);
        }
        rows.to_string()
    });
    Ok(DONE)
}

/// Prints at most `max_messages` messages of a topic of a recording; of a long list only `max_items`.
pub fn echo(file: &Path, topic: &str, max_messages: u64, max_items: usize, print: Print) -> CommandResult {
    check(file, topic)?;
    let mut echo = Echo { left: max_messages, max_items, print };
    read(file, topic, &mut echo)?;
    Ok(DONE)
}

/// Passes the messages of one topic to `tap`.
///
/// # Errors
/// The file is no recording, or has no such topic.
pub fn read(file: &Path, topic: &str, tap: &mut dyn Tap) -> Result<(), Failure> {
    let played = play_topics(file, tap, &|name| name == topic).map_err(failure)?;
    for what in played.left_out.iter().chain(&played.broken_off) {
        complain(&format!("{}: {}", file.display(), printable(what)));
    }
    Ok(())
}

/// Refuses a topic that the recording does not hold.
///
/// # Errors
/// The file is no recording, or has no such topic.
pub fn check(file: &Path, topic: &str) -> Result<(), Failure> {
    let topics = topics(file)?;
    if topics.iter().any(|known| known.name == topic) {
        return Ok(());
    }
    let names = topics.iter().map(|topic| topic.name.as_str());
    let instead = instead(topic, names, "topic");
    Err(Failure::usage(format!("{} has no topic `{topic}`: {instead}", file.display())))
}

fn topics(file: &Path) -> Result<Vec<Recorded>, Failure> {
    let contents = info(file).map_err(failure)?;
    let own =
        contents.topics.into_iter().filter(|(_, topic)| MessageType::find(&topic.message_type).is_some());
    let recorded = own.map(|(name, topic)| Recorded {
        name,
        message: topic.message_type,
        messages: topic.messages,
        rate_hz: topic.rate_hz,
        largest_gap_s: topic.largest_gap_s,
    });
    Ok(recorded.collect())
}

fn failure(error: PlaybackError) -> Failure {
    Failure::usage(error)
}

/// Prints messages.
struct Echo {
    left: u64,
    max_items: usize,
    print: Print,
}

impl Tap for Echo {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if self.left == 0 {
            return;
        }
        self.left -= 1;
        let value = yamabico_runtime::record::to_json(message, header, items);
        let text = match self.print {
            Print::Json => value.to_string(),
            Print::Text => message_text(&value, time, self.max_items),
        };
        if writeln!(std::io::stdout(), "{}", printable(&text)).is_err() {
            self.left = 0;
        }
    }
}
