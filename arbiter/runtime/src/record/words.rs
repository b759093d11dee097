//! Codes in words, and what a person reads in the log of a recording.

use std::collections::HashMap;

use foxglove::messages::Log;
use foxglove::messages::log::Level;
use serde_json::Value;
use yamabico_core::message::{
    Control, ControlKind, DecisionHeader, Encoding, FrameHeader, Heartbeat, Kind, Message, MessageType, Mode,
    Outcome, PluginState, Pose, PoseStatus, Proposal, Reason,
};

use super::frames::timestamp;

/// What a code means.
type Words = fn(u32) -> Option<&'static str>;
/// A field that holds a code.
type Field = (&'static str, Words);

macro_rules! words {
    ($ty:ident) => {
        |code| $ty::from_code(code).map($ty::as_str)
    };
}

const ENCODING: Field = ("encoding", words!(Encoding));
const KIND: Field = ("kind", words!(Kind));
const REASON: Field = ("reason", words!(Reason));
const MODE: Field = ("mode", words!(Mode));
const OUTCOME: Field = ("outcome", words!(Outcome));
const STATE: Field = ("state", words!(PluginState));
const STATUS: Field = ("status", words!(PoseStatus));
const CONTROL: Field = ("kind", words!(ControlKind));

/// Adds to each code of a message and of its items what it means, as `..._text`; a code without meaning says so.
pub(super) fn explain(message: &MessageType, value: &mut Value) {
    let (fields, item_fields): (&[Field], &[Field]) = match message.name {
        FrameHeader::NAME => (&[ENCODING], &[]),
        Proposal::NAME => (&[KIND, REASON], &[]),
        DecisionHeader::NAME => (&[MODE], &[OUTCOME, REASON, KIND]),
        Heartbeat::NAME => (&[STATE], &[]),
        Pose::NAME => (&[STATUS], &[]),
        Control::NAME => (&[CONTROL], &[]),
        _ => return,
    };
    add(value, fields);
    if let Some(items) = value.get_mut("items").and_then(Value::as_array_mut) {
        items.iter_mut().for_each(|item| add(item, item_fields));
    }
}

fn add(value: &mut Value, fields: &[Field]) {
    let Some(object) = value.as_object_mut() else { return };
    for (field, words) in fields {
        let code = object.get(*field).and_then(Value::as_u64).and_then(|code| u32::try_from(code).ok());
        let text = code.and_then(words).unwrap_or("unknown");
        object.insert(format!("{field}_text"), text.into());
    }
}

/// Writes a line whenever somebody changes his mind, not once a message.
#[derive(Default)]
pub(super) struct Journal {
    last: HashMap<String, (u32, u32)>,
}

impl Journal {
    /// A line where the proposal's kind or reason differ from this author's last.
    pub fn proposal(&mut self, topic: &str, proposal: &Proposal) -> Option<Log> {
        self.changed(topic, (proposal.kind, proposal.reason)).then(|| {
            let kind = proposal.kind().map_or("unknown kind", Kind::as_str);
            let reason = proposal.reason().map_or("unknown reason", Reason::as_str);
            let level = if proposal.kind() == Some(Kind::Halt) { Level::Warning } else { Level::Info };
            let note = proposal.note.as_str();
            let says_more = !note.is_empty() && note != reason;
            let note = if says_more { format!(" ({note})") } else { String::new() };
            line(proposal.stamp_ns, level, proposal.behavior.as_str(), format!("{kind}: {reason}{note}"))
        })
    }

    /// A line where the arbiter's mode differs from the last.
    pub fn decision(&mut self, topic: &str, decision: &DecisionHeader) -> Option<Log> {
        self.changed(topic, (decision.mode, decision.halted.bits())).then(|| {
            let mode = decision.mode().map_or("unknown mode", Mode::as_str);
            let level = match decision.mode() {
                Some(Mode::Driving | Mode::Idle | Mode::ShuttingDown) => Level::Info,
                Some(Mode::Halted) => Level::Warning,
                Some(Mode::CriticalSilent | Mode::EmergencyStop) | None => Level::Error,
            };
            let note = decision.note.as_str();
            let note = if note.is_empty() { String::new() } else { format!(": {note}") };
            line(decision.stamp_ns, level, "arbiter", format!("{mode}{note}"))
        })
    }

    /// A line where a plugin's state or number of restarts differ from the last.
    pub fn heartbeat(&mut self, topic: &str, heartbeat: &Heartbeat) -> Option<Log> {
        let plugin = heartbeat.plugin.as_str();
        self.changed(&format!("{topic}/{plugin}"), (heartbeat.state, heartbeat.restarts)).then(|| {
            let state = PluginState::from_code(heartbeat.state);
            let level = if state == Some(PluginState::Failed) { Level::Error } else { Level::Info };
            let words = state.map_or("unknown state", PluginState::as_str);
            let restarts = match heartbeat.restarts {
                0 => String::new(),
                restarts => format!(", started again {restarts} times"),
            };
            line(heartbeat.stamp_ns, level, plugin, format!("{words}{restarts}"))
        })
    }

    /// A line for every request.
    pub fn control(&mut self, control: &Control) -> Log {
        let kind = control.kind().map_or("unknown request", ControlKind::as_str);
        let message = format!("{kind} {}", control.note).trim_end().to_owned();
        line(control.stamp_ns, Level::Info, control.target.as_str(), message)
    }

    fn changed(&mut self, who: &str, state: (u32, u32)) -> bool {
        match self.last.get_mut(who) {
            Some(last) => std::mem::replace(last, state) != state,
            None => self.last.insert(who.to_owned(), state).is_none(),
        }
    }
}

fn line(stamp_ns: u64, level: Level, name: &str, message: String) -> Log {
    Log {
        timestamp: Some(timestamp(stamp_ns)),
        level: level as i32,
        message,
        name: name.to_owned(),
        file: String::new(),
        line: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Name};

    #[test]
    fn codes_are_explained_and_unknown_ones_said_so() {
        let proposal = Proposal { reason: 4711, ..Proposal::halt(Axes::ALL, Reason::Echo) };
        let message = MessageType::of::<Proposal>();
        let mut value = (message.to_json)(bytemuck::bytes_of(&proposal), &[]);
        explain(&message, &mut value);
        assert_eq!((&value["kind_text"], &value["reason_text"]), (&"halt".into(), &"unknown".into()));
        assert_eq!(value["reason"], 4711);
    }

    #[test]
    fn a_change_of_mind_is_one_line() {
        let mut journal = Journal::default();
        let halt = Proposal { behavior: Name::new("sonar-halt"), ..Proposal::halt(Axes::ALL, Reason::Echo) }
            .with_note(format_args!("0.41 m ahead"));
        let log = journal.proposal("p", &halt).unwrap();
        assert_eq!((log.name.as_str(), log.message.as_str()), ("sonar-halt", "halt: echo (0.41 m ahead)"));
        assert_eq!(log.level, Level::Warning as i32);
        assert!(journal.proposal("p", &halt).is_none());
        let silent = Proposal::halt(Axes::ALL, Reason::NoInput).with_note(format_args!("no input"));
        assert_eq!(journal.proposal("p", &silent).unwrap().message, "halt: no input");
        assert!(journal.proposal("p", &Proposal::abstain(Reason::Clear)).is_some());
        let decision = DecisionHeader { mode: Mode::CriticalSilent.code(), ..Default::default() };
        assert_eq!(journal.decision("d", &decision).unwrap().message, "critical part silent");
        assert!(journal.decision("d", &decision).is_none());
    }
}
