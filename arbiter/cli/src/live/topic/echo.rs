//! `yamabico topic echo`: messages as they pass.

use std::io::Write;
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

use clap::Args;
use serde_json::Value;
use yamabico_core::time::Time;
use yamabico_runtime::record::to_json;

use super::super::which::Which;
use super::{NAP, WAITING, listen};
use crate::output::{DONE, NOT_ARRIVED, Print, exit, fail};

/// Items of a list that are shown of a longer one.
const MAX_ITEMS: usize = 4;

/// What `topic echo` is told.
#[derive(Args)]
pub struct Arguments {
    /// The topic.
    topic: String,
    /// One message only.
    #[arg(long, conflicts_with = "count")]
    once: bool,
    /// So many messages; without it, until Ctrl-C.
    #[arg(long = "number", short = 'n', value_name = "N")]
    count: Option<u64>,
    /// Lists in full.
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    robot: Which,
}

/// Prints messages.
pub fn echo(arguments: &Arguments, print: Print) -> ExitCode {
    let (mut listener, flag) = match listen(&arguments.robot, &arguments.topic) {
        Ok(listening) => listening,
        Err(code) => return code,
    };
    let message = *listener.message();
    let most = if arguments.once { 1 } else { arguments.count.unwrap_or(u64::MAX) };
    let max_items = if arguments.full { usize::MAX } else { MAX_ITEMS };
    let (mut printed, began) = (0, Instant::now());
    let mut is_told = print == Print::Json;
    while !flag.load(Ordering::Relaxed) && printed < most {
        let heard = listener.hear(NAP, &mut |heard| {
            let value = to_json(&message, heard.sample.header(), heard.sample.items());
            let text = match print {
                Print::Json => value.to_string(),
                Print::Text => in_words(&value, heard.now, max_items),
            };
            printed += 1;
            match writeln!(std::io::stdout(), "{text}") {
                Ok(()) if printed < most => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        });
        match heard {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => break,
            Err(error) => return fail(&error.to_string(), NOT_ARRIVED),
        }
        if !is_told && printed == 0 && began.elapsed() > WAITING {
            is_told = true;
            eprintln!("waiting for a message on {} (Ctrl-C ends it)", arguments.topic);
        }
    }
    exit(DONE)
}

/// The message as an indented list of its fields, received at `at`; of long lists the first items.
fn in_words(value: &Value, at: Time, max_items: usize) -> String {
    let mut text = String::new();
    if let Some(fields) = value.as_object() {
        for (name, value) in fields {
            // A code is told by its words.
            if fields.contains_key(&format!("{name}_text")) || is_for_machines(name) {
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
            let shown: Vec<String> = items.iter().take(max_items.max(9)).map(scalar).collect();
            let more = items.len().saturating_sub(shown.len());
            let more = if more > 0 { format!(", ... {more} more") } else { String::new() };
            *text += &format!("{indent}{name}: [{}{more}]\n", shown.join(", "));
        }
        Value::Array(items) => {
            *text += &format!("{indent}{name}: {} of them\n", items.len());
            for item in items.iter().take(max_items) {
                *text += &format!("{indent}  - {}\n", on_a_line(item));
            }
            if items.len() > max_items {
                *text += &format!("{indent}  ... {} more (--full)\n", items.len() - max_items);
            }
        }
        Value::Object(_) => *text += &format!("{indent}{name}: {}\n", on_a_line(value)),
        Value::Number(number) if name.ends_with("_ns") => {
            let stamp = number.as_u64().unwrap_or(0);
            let age_ms = at.seconds_after(Time(stamp)) * 1e3;
            let age =
                if stamp == 0 { String::new() } else { format!("  ({age_ms:.2} ms before it arrived)") };
            *text += &format!("{indent}{name}: {stamp}{age}\n");
        }
        value => *text += &format!("{indent}{name}: {}\n", scalar(value)),
    }
}

/// An item's fields in one line.
fn on_a_line(value: &Value) -> String {
    let Some(fields) = value.as_object() else { return scalar(value) };
    let shown = fields
        .iter()
        .filter(|(name, _)| !fields.contains_key(&format!("{name}_text")) && !is_for_machines(name));
    let shown = shown
        .map(|(name, value)| format!("{} {}", name.strip_suffix("_text").unwrap_or(name), on_a_line(value)));
    shown.collect::<Vec<_>>().join(", ")
}

/// What fills a message up, and what says the same in other words.
fn is_for_machines(name: &str) -> bool {
    name == "reserved" || name.ends_with("_hex")
}

/// Four digits behind the point are enough for a reader.
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
    fn codes_are_words_stamps_are_ages_and_lists_are_short() {
        let scan = RangeScanHeader { stamp_ns: 1_000_000_000, max_m: 3.0, ..Default::default() };
        let beams = [Beam { range_m: 0.41234567, ..Default::default() }; 7];
        let message = MessageType::of::<RangeScanHeader>();
        let value = to_json(&message, bytemuck::bytes_of(&scan), bytemuck::cast_slice(&beams));
        let text = in_words(&value, Time(1_012_000_000), MAX_ITEMS);
        assert!(text.contains("stamp_ns: 1000000000  (12.00 ms before it arrived)"), "{text}");
        assert!(text.contains("items: 7 of them") && text.contains("... 3 more (--full)"), "{text}");
        assert!(text.contains("range_m 0.4123"), "{text}");
        let halt = Proposal { kind: Kind::Halt.code(), reason: Reason::Echo.code(), ..Proposal::default() };
        let value = to_json(&MessageType::of::<Proposal>(), bytemuck::bytes_of(&halt), &[]);
        let text = in_words(&value, Time::ZERO, MAX_ITEMS);
        assert!(text.contains("kind: halt\n") && text.contains("reason: echo\n"), "{text}");
        assert_eq!(Proposal::NAME, "yamabico.Proposal.v2");
    }

    #[test]
    fn every_message_can_be_told() {
        for message in ALL {
            let value = to_json(message, &vec![0; message.header_size], &vec![0; 2 * message.item_size]);
            let text = in_words(&value, Time::ZERO, MAX_ITEMS);
            assert!(text.lines().count() > 1 && !text.contains("null"), "{}: {text}", message.name);
        }
    }
}
