//! The text of the Python package's message classes.

use std::fmt::Write;

use yamabico_core::message::{
    ALL, Axis, Channel, ControlKind, Encoding, Kind, Layout, MessageType, Mode, NO_ECHO, Outcome,
    PluginState, PoseStatus, Reason, RetuneStep, Retuning, StructLayout, TurnPhase,
};
use yamabico_host::process::PROTOCOL;
use yamabico_host::topics;

/// Where it belongs, from the crate's folder on.
pub const FILE: &str = "../python/yamabico/messages.py";

const HEAD: &str = r#""""The messages of Yamabico as they lie in shared memory, and the words that their codes stand for.

Written by `cargo run -p yamabico-core --example python_messages`; not to be edited.
"""

import ctypes
from enum import IntEnum, IntFlag

from .structure import Item, Message, text
"#;

/// The module `messages`.
pub fn messages() -> String {
    let mut text = HEAD.to_owned();
    let mut constant = |name: &str, value: &dyn std::fmt::Display| {
        let _ = write!(text, "\n{name} = {value}");
    };
    constant("PROTOCOL", &PROTOCOL);
    constant("NO_ECHO", &NO_ECHO);
    for (name, topic) in [
        ("COMMAND", topics::COMMAND),
        ("TRUTH", topics::TRUTH),
        ("CLOCK", topics::CLOCK),
        ("TURNS", topics::TURNS),
        ("TAKEN", topics::TAKEN),
        ("HEARTBEATS", topics::HEARTBEATS),
        ("CALLS", topics::CALLS),
        ("FAILURES", topics::FAILURES),
        ("MEMORIES", topics::MEMORIES),
        ("DECISION", topics::DECISION),
        ("RETUNE", topics::RETUNE),
        ("RETUNED", topics::RETUNED),
    ] {
        constant(&format!("{name}_TOPIC"), &format!("{topic:?}"));
    }
    text.push('\n');
    let axes = Axis::ALL.map(|axis| (format!("{axis:?}"), 1 << axis as u32));
    write_codes(&mut text, "Axes", "IntFlag", "Axes of motion in the robot frame.", &axes);
    macro_rules! vocabularies {
        ($($ty:ident $docs:literal),* $(,)?) => {$(
            let words: Vec<_> = $ty::ALL.iter().map(|word| (format!("{word:?}"), word.code())).collect();
            write_codes(&mut text, stringify!($ty), "IntEnum", $docs, &words);
        )*};
    }
    vocabularies! {
        Encoding "How the bytes of a frame are to be read.",
        Kind "What a proposal asks for.",
        Reason "Why a behavior proposes what it does.",
        PoseStatus "How far a pose can be trusted.",
        PluginState "How a plugin fares.",
        TurnPhase "What a turn of a step is for.",
        Mode "The arbiter's state at a decision.",
        Outcome "What became of a proposal.",
        ControlKind "What somebody asks of a running robot.",
        RetuneStep "How far a change of parameters is.",
        Retuning "What became of a change of parameters.",
    }
    let mut written = Vec::new();
    for message in ALL {
        let item = match message.item {
            Layout::Struct(item) => {
                write_item(&mut text, item, &mut written);
                item.name
            }
            _ => "None",
        };
        if let Layout::Struct(header) = message.header {
            write_parts(&mut text, header, &mut written);
            write_message(&mut text, header, message, item);
        }
    }
    let _ = write!(text, "\n\n#: Every message by its versioned name.\nMESSAGES = {{");
    for message in ALL {
        if let Layout::Struct(header) = message.header {
            let _ = write!(text, "\n    {:?}: {},", message.name, header.name);
        }
    }
    text + "\n}\n"
}

fn write_codes(text: &mut String, name: &str, base: &str, docs: &str, codes: &[(String, u32)]) {
    let _ = write!(text, "\n\nclass {name}({base}):\n    \"\"\"{docs}\"\"\"\n");
    for (word, code) in codes {
        let _ = write!(text, "\n    {} = {code}", upper_snake(word));
    }
    text.push('\n');
}

fn write_parts(text: &mut String, layout: &StructLayout, written: &mut Vec<&'static str>) {
    for field in layout.fields {
        let mut part = field.layout;
        while let Layout::Array(element, _) = part {
            part = *element;
        }
        if let Layout::Struct(part) = part {
            write_item(text, part, written);
        }
    }
}

fn write_item(text: &mut String, layout: &StructLayout, written: &mut Vec<&'static str>) {
    write_parts(text, layout, written);
    if !written.contains(&layout.name) {
        written.push(layout.name);
        write_class(text, layout, "Item");
        let _ = writeln!(text, "\n\nassert ctypes.sizeof({}) == {}", layout.name, layout.size);
    }
}

fn write_message(text: &mut String, header: &StructLayout, message: &MessageType, item: &str) {
    write_class(text, header, "Message");
    let channel = match message.channel {
        Channel::Latest => "latest",
        Channel::Stream => "stream",
    };
    let _ = writeln!(text, "    NAME = {:?}\n    CHANNEL = {channel:?}\n    ITEM = {item}", message.name);
    let size = message.header_size;
    let _ = writeln!(
        text,
        "\n\nassert ctypes.sizeof({0}) == {size} and ctypes.alignment({0}) == {1}",
        header.name, message.header_align
    );
}

fn write_class(text: &mut String, layout: &StructLayout, base: &str) {
    let name = layout.name;
    let _ = write!(text, "\n\nclass {name}({base}):\n    \"\"\"{}\"\"\"\n\n", docs(layout.docs, "\n\n    "));
    text.push_str("    _fields_ = [\n");
    for field in layout.fields {
        let _ = writeln!(text, "        # {}", docs(field.docs, " "));
        let name = if is_text(&field.layout) { format!("_{}", field.name) } else { field.name.to_owned() };
        let _ = writeln!(text, "        (\"{name}\", {}),", type_of(&field.layout));
    }
    text.push_str("    ]\n");
    for field in layout.fields.iter().filter(|field| is_text(&field.layout)) {
        let _ = writeln!(text, "    {0} = text(\"_{0}\")", field.name);
    }
}

fn is_text(layout: &Layout) -> bool {
    match layout {
        Layout::Text(_) => true,
        Layout::Array(element, _) => is_text(element),
        _ => false,
    }
}

fn type_of(layout: &Layout) -> String {
    match layout {
        Layout::U8 => "ctypes.c_uint8".into(),
        Layout::U32 => "ctypes.c_uint32".into(),
        Layout::I32 => "ctypes.c_int32".into(),
        Layout::U64 => "ctypes.c_uint64".into(),
        Layout::F64 => "ctypes.c_double".into(),
        Layout::Text(bytes) => format!("ctypes.c_char * {bytes}"),
        Layout::Array(element, len) => format!("({}) * {len}", type_of(element)),
        Layout::Struct(part) => part.name.into(),
    }
}

/// Docs without the marks of code and links.
fn docs(docs: &str, between: &str) -> String {
    let mut plain = docs.trim().replace("[`", "").replace("`]", "\u{1}").replace('`', "");
    while let Some(begin) = plain.find("\u{1}(") {
        let end = plain[begin..].find(')').map_or(begin, |length| begin + length);
        plain.replace_range(begin..=end, "");
    }
    let plain = plain.replace('\u{1}', "");
    let paragraphs: Vec<String> = plain
        .split("\n\n")
        .map(|paragraph| paragraph.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    paragraphs.join(between)
}

fn upper_snake(camel: &str) -> String {
    let mut snake = String::new();
    for (at, letter) in camel.char_indices() {
        if letter.is_uppercase() && at > 0 {
            snake.push('_');
        }
        snake.extend(letter.to_uppercase());
    }
    snake
}
