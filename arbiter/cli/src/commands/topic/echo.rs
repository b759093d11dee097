//! `yamabico topic echo`: the messages of a topic, printed.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::Instant;

use clap::Args;
use serde_json::Value;
use yamabico_core::time::Time;
use yamabico_runtime::record::to_json;

use super::recording::{self, RecordingArgument};
use super::{INTERRUPT_CHECK, WAITING, subscribe};
use crate::output::{CommandResult, DONE, Print, complain, printable};
use crate::robot_argument::RobotArgument;

/// Maximum number of printed items of a list.
const MAX_ITEMS: usize = 4;
/// Maximum number of printed items of a list of numbers.
const MAX_NUMBERS: usize = 9;

/// Arguments of `topic echo`.
#[derive(Args)]
pub struct Arguments {
    /// Topic, as `yamabico topic list` prints it.
    topic: String,
    /// Print one message only.
    #[arg(long, conflicts_with = "count")]
    once: bool,
    /// Number of messages to print; by default until Ctrl-C.
    #[arg(long = "number", short = 'n', value_name = "N")]
    count: Option<u64>,
    /// Print long lists in full.
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    file: RecordingArgument,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Prints messages.
pub fn echo(arguments: &Arguments, print: Print) -> CommandResult {
    let max_messages = if arguments.once { 1 } else { arguments.count.unwrap_or(u64::MAX) };
    let max_items = if arguments.full { usize::MAX } else { MAX_ITEMS };
    if let Some(file) = &arguments.file.recording {
        return recording::echo(file, &arguments.topic, max_messages, max_items, print);
    }
    let (mut subscriber, interrupt) = subscribe(&arguments.robot, &arguments.topic)?;
    let message = *subscriber.message();
    let (mut printed, began) = (0, Instant::now());
    let mut is_informed = print == Print::Json;
    while !interrupt.load(Ordering::Relaxed) && printed < max_messages {
        let received = subscriber.receive(INTERRUPT_CHECK, &mut |received| {
            let value = to_json(&message, received.sample.header(), received.sample.items());
            let text = match print {
                Print::Json => value.to_string(),
                Print::Text => message_text(&value, received.now, max_items),
            };
            printed += 1;
            match writeln!(std::io::stdout(), "{}", printable(&text)) {
                Ok(()) if printed < max_messages => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        });
        if received?.is_break() {
            break;
        }
        if !is_informed && printed == 0 && began.elapsed() > WAITING {
            is_informed = true;
            complain(&format!(
                "waiting for a message on {}; press Ctrl-C to end",
                printable(&arguments.topic)
            ));
        }
    }
    Ok(DONE)
}

/// The fields of a message received at `at`, one a line; of a long list only the first items.
pub(super) fn message_text(value: &Value, at: Time, max_items: usize) -> String {
    let mut text = String::new();
    if let Some(fields) = value.as_object() {
        for (name, value) in fields {
            // The text of a code stands for the code.
            if fields.contains_key(&format!("{name}_text")) || is_redundant(name) {
                continue;
            }
            field(&mut text, name.strip_suffix("_text").unwrap_or(name), value, at, max_items, 0);
        }
    }
    text + "---"
}

fn field(text: &mut String, name: &str, value: &Value, at: Time, max_items: usize, depth: usize) {
    let indent = "  ".repeat(depth);
    match value {
        Value::Array(items) if items.iter().all(|item| !item.is_object()) => {
            let shown: Vec<String> = items.iter().take(max_items.max(MAX_NUMBERS)).map(scalar).collect();
            let more = items.len().saturating_sub(shown.len());
            let more = if more > 0 { format!(", ... {more} more") } else { String::new() };
            *text += &format!("{indent}{name}: [{}{more}]\n", shown.join(", "));
        }
        Value::Array(items) => {
            *text += &format!("{indent}{name}: {} items\n", items.len());
            for item in items.iter().take(max_items) {
                *text += &format!("{indent}  - {}\n", one_line(item));
            }
            if items.len() > max_items {
                *text += &format!("{indent}  ... {} more (--full)\n", items.len() - max_items);
            }
        }
        Value::Object(_) => *text += &format!("{indent}{name}: {}\n", one_line(value)),
        Value::Number(number) if name.ends_with("_ns") => {
            let stamp = number.as_u64().unwrap_or(0);
            let age_ms = at.seconds_after(Time(stamp)) * 1e3;
            let age = if stamp == 0 { String::new() } else { format!("  ({age_ms:.2} ms before arrival)") };
            *text += &format!("{indent}{name}: {stamp}{age}\n");
        }
        value => *text += &format!("{indent}{name}: {}\n", scalar(value)),
    }
}

/// The fields of an item on one line.
fn one_line(value: &Value) -> String {
    let Some(fields) = value.as_object() else { return scalar(value) };
    let shown = fields
        .iter()
        .filter(|(name, _)| !fields.contains_key(&format!("{name}_text")) && !is_redundant(name));
    let shown = shown
        .map(|(name, value)| format!("{} {}", name.strip_suffix("_text").unwrap_or(name), one_line(value)));
    shown.collect::<Vec<_>>().join(", ")
}

/// Returns true for padding, and for a field that repeats another one in another notation.
fn is_redundant(name: &str) -> bool {
    name == "reserved" || name.ends_with("_hex")
}

/// A value as text; a number with four decimals.
fn scalar(value: &Value) -> String {
    match value {
        Value::Null => "not finite".to_owned(),
        Value::String(text) if text.is_empty() => "-".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => match number.as_f64().filter(|_| number.is_f64()) {
            Some(0.0) => "0".to_owned(),
            Some(number) if number.abs() < 1e-3 || number.abs() >= 1e6 => format!("{number:.3e}"),
            Some(number) => format!("{number:.4}"),
            None => number.to_string(),
        },
        Value::Array(items) => format!("[{}]", items.iter().map(scalar).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{ALL, Beam, Kind, Message, MessageType, Proposal, RangeScanHeader, Reason};

    #[test]
    fn codes_are_texts_stamps_have_ages_and_lists_are_short() {
        let scan = RangeScanHeader { stamp_ns: 1_000_000_000, max_m: 3.0, ..Default::default() };
        let beams = [Beam { range_m: 0.41234567, ..Default::default() }; 7];
        let message = MessageType::of::<RangeScanHeader>();
        let value = to_json(&message, bytemuck::bytes_of(&scan), bytemuck::cast_slice(&beams));
        let text = message_text(&value, Time(1_012_000_000), MAX_ITEMS);
        assert!(text.contains("stamp_ns: 1000000000  (12.00 ms before arrival)"), "{text}");
        assert!(text.contains("items: 7 items") && text.contains("... 3 more (--full)"), "{text}");
        assert!(text.contains("range_m 0.4123"), "{text}");
        let halt = Proposal { kind: Kind::Halt.code(), reason: Reason::Echo.code(), ..Proposal::default() };
        let value = to_json(&MessageType::of::<Proposal>(), bytemuck::bytes_of(&halt), &[]);
        let text = message_text(&value, Time::ZERO, MAX_ITEMS);
        assert!(text.contains("kind: halt\n") && text.contains("reason: echo\n"), "{text}");
        assert_eq!(Proposal::NAME, "yamabico.Proposal.v2");
    }

    #[test]
    fn every_message_can_be_printed() {
        for message in ALL {
            let value = to_json(message, &vec![0; message.header_size], &vec![0; 2 * message.item_size]);
            let text = message_text(&value, Time::ZERO, MAX_ITEMS);
            assert!(text.lines().count() > 1 && !text.contains("null"), "{}: {text}", message.name);
        }
    }
}
