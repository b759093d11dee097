//! `yamabico why FILE.mcap`: the decisions of a recording, explained.

use std::io::Write;
use std::path::Path;

use yamabico_core::message::{DecisionHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;
use yamabico_view::model::Model;
use yamabico_view::recording::{Recording, RecordingError};

use super::{Gist, json};
use crate::output::{CommandResult, DONE, Failure, Print, complain, printable};

/// Explains the decision at `at_s` seconds, by default the last one.
pub fn explain_at(file: &Path, at_s: Option<f64>, print: Print) -> CommandResult {
    let mut recording = open(file)?;
    let at_s = at_s.unwrap_or(recording.duration_s());
    let model = recording.at(at_s).map_err(failure)?;
    if let Some(text) = explanation(&model, print) {
        print_line(&text);
    }
    Ok(DONE)
}

/// Explains every decision that differs from the one before in more than its numbers.
pub fn explain_every_change(file: &Path, print: Print) -> CommandResult {
    let mut recording = open(file)?;
    let mut changes = Changes { model: Model::default(), last: None, print };
    recording.replay(&mut changes).map_err(failure)?;
    Ok(DONE)
}

fn open(file: &Path) -> Result<Recording, Failure> {
    let recording = Recording::open(file).map_err(failure)?;
    if let Some(cause) = recording.broken_off() {
        complain(&format!("{}: {cause}", file.display()));
    }
    Ok(recording)
}

fn failure(error: RecordingError) -> Failure {
    match error {
        RecordingError::NoDecision { .. } => Failure::not_done(error),
        error => Failure::device(error),
    }
}

/// Prints the explanation of each changed decision.
struct Changes {
    model: Model,
    last: Option<Gist>,
    print: Print,
}

impl Tap for Changes {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.model.message(topic, message, time, header, items);
        if message.name != DecisionHeader::NAME {
            return;
        }
        let gist = self.model.decision().map(Gist::new);
        if gist != self.last {
            self.last = gist;
            if let Some(text) = explanation(&self.model, self.print) {
                print_line(&text);
            }
        }
    }
}

/// Explanation of the newest decision with its time.
fn explanation(model: &Model, print: Print) -> Option<String> {
    let (decision, explanation) = (model.decision()?, model.explanation()?);
    let at_s = model.seconds(Time(decision.header.stamp_ns));
    Some(match print {
        Print::Json => {
            let mut value = json("", decision, &explanation);
            value["at_s"] = at_s.into();
            value.to_string()
        }
        Print::Text => format!("[{at_s:8.2} s] {explanation}"),
    })
}

fn print_line(text: &str) {
    // A closed pipe ends the program elsewhere.
    let _ = writeln!(std::io::stdout(), "{}", printable(text));
}
