//! Texts of codes, and the log of a recording.

use std::collections::HashMap;

use foxglove::messages::Log;
use foxglove::messages::log::Level;
use serde_json::Value;
use yamabico_core::message::{
    Control, ControlKind, DecisionHeader, Encoding, FrameHeader, Heartbeat, Kind, Message, MessageType, Mode,
    Outcome, PluginState, Pose, PoseStatus, Proposal, Reason, Verdict,
};

use super::control_log::ControlLog;
use super::frames::timestamp;

/// Conversion of a code to its text.
type CodeText = fn(u32) -> Option<&'static str>;
/// A field that holds a code.
type Field = (&'static str, CodeText);

macro_rules! code_text {
    ($ty:ident) => {
        |code| $ty::from_code(code).map($ty::as_str)
    };
}

const ENCODING: Field = ("encoding", code_text!(Encoding));
const KIND: Field = ("kind", code_text!(Kind));
const REASON: Field = ("reason", code_text!(Reason));
const MODE: Field = ("mode", code_text!(Mode));
const OUTCOME: Field = ("outcome", code_text!(Outcome));
const STATE: Field = ("state", code_text!(PluginState));
const STATUS: Field = ("status", code_text!(PoseStatus));
const CONTROL: Field = ("kind", code_text!(ControlKind));

/// Adds the text of each code of a message and of its items as `..._text`; an unknown code becomes `unknown`.
pub(super) fn add_texts(message: &MessageType, value: &mut Value) {
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
    for (field, text_of) in fields {
        let code = object.get(*field).and_then(Value::as_u64).and_then(|code| u32::try_from(code).ok());
        let text = code.and_then(text_of).unwrap_or("unknown");
        object.insert(format!("{field}_text"), text.into());
    }
}

/// Log of changes: one line for each change, not for each message.
#[derive(Default)]
pub(super) struct ChangeLog {
    last: HashMap<String, (u32, u32)>,
    control: ControlLog,
}

impl ChangeLog {
    /// Line for a proposal whose kind or reason differs from the author's last.
    pub fn proposal(&mut self, topic: &str, proposal: &Proposal) -> Option<Log> {
        self.control.proposal(proposal);
        self.changed(topic, (proposal.kind, proposal.reason)).then(|| {
            let kind = proposal.kind().map_or("unknown kind", Kind::as_str);
            let reason = proposal.reason().map_or("unknown reason", Reason::as_str);
            let level = if proposal.kind() == Some(Kind::Halt) { Level::Warning } else { Level::Info };
            let note = proposal.note.as_str();
            let adds_information = !note.is_empty() && note != reason;
            let note = if adds_information { format!(" ({note})") } else { String::new() };
            line(proposal.stamp_ns, level, proposal.behavior.as_str(), format!("{kind}: {reason}{note}"))
        })
    }

    /// Lines for a decision: for a mode or halted axes that differ from the last, and for each change of control.
    pub fn decision(&mut self, topic: &str, decision: &DecisionHeader, verdicts: &[Verdict]) -> Vec<Log> {
        let stamp_ns = decision.stamp_ns;
        let mode = self.changed(topic, (decision.mode, decision.halted.bits())).then(|| {
            let mode = decision.mode().map_or("unknown mode", Mode::as_str);
            let level = match decision.mode() {
                Some(Mode::Driving | Mode::Idle | Mode::ShuttingDown) => Level::Info,
                Some(Mode::Halted) => Level::Warning,
                Some(Mode::CriticalSilent | Mode::EmergencyStop) | None => Level::Error,
            };
            let note = decision.note.as_str();
            let note = if note.is_empty() { String::new() } else { format!(": {note}") };
            line(stamp_ns, level, "arbiter", format!("{mode}{note}"))
        });
        let changes = self.control.decision(decision, verdicts).into_iter();
        mode.into_iter()
            .chain(changes.map(|(who, text)| line(stamp_ns, Level::Info, who.as_str(), text)))
            .collect()
    }

    /// Line for a heartbeat whose state or number of restarts differs from the plugin's last.
    pub fn heartbeat(&mut self, topic: &str, heartbeat: &Heartbeat) -> Option<Log> {
        let plugin = heartbeat.plugin.as_str();
        self.changed(&format!("{topic}/{plugin}"), (heartbeat.state, heartbeat.restarts)).then(|| {
            let state = PluginState::from_code(heartbeat.state);
            let level = if state == Some(PluginState::Failed) { Level::Error } else { Level::Info };
            let text = state.map_or("unknown state", PluginState::as_str);
            let restarts = match heartbeat.restarts {
                0 => String::new(),
                1 => ", restarted once".to_owned(),
                restarts => format!(", restarted {restarts} times"),
            };
            line(heartbeat.stamp_ns, level, plugin, format!("{text}{restarts}"))
        })
    }

    /// Line for a request.
    pub fn control(&mut self, control: &Control) -> Log {
        let kind = control.kind().map_or("unknown request", ControlKind::as_str);
        let message = format!("{kind} {}", control.note).trim_end().to_owned();
        line(control.stamp_ns, Level::Info, control.target.as_str(), message)
    }

    fn changed(&mut self, author: &str, state: (u32, u32)) -> bool {
        match self.last.get_mut(author) {
            Some(last) => std::mem::replace(last, state) != state,
            None => self.last.insert(author.to_owned(), state).is_none(),
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
    fn codes_get_texts_and_unknown_ones_are_marked() {
        let proposal = Proposal { reason: 4711, ..Proposal::halt(Axes::ALL, Reason::Echo) };
        let message = MessageType::of::<Proposal>();
        let mut value = message.to_json(bytemuck::bytes_of(&proposal), &[]);
        add_texts(&message, &mut value);
        assert_eq!((&value["kind_text"], &value["reason_text"]), (&"halt".into(), &"unknown".into()));
        assert_eq!(value["reason"], 4711);
    }

    #[test]
    fn a_change_is_one_line() {
        let mut changes = ChangeLog::default();
        let halt = Proposal { behavior: Name::new("sonar-halt"), ..Proposal::halt(Axes::ALL, Reason::Echo) }
            .with_note(format_args!("0.41 m ahead"));
        let log = changes.proposal("p", &halt).unwrap();
        assert_eq!((log.name.as_str(), log.message.as_str()), ("sonar-halt", "halt: echo (0.41 m ahead)"));
        assert_eq!(log.level, Level::Warning as i32);
        assert!(changes.proposal("p", &halt).is_none());
        let silent = Proposal::halt(Axes::ALL, Reason::NoInput).with_note(format_args!("no input"));
        assert_eq!(changes.proposal("p", &silent).unwrap().message, "halt: no input");
        assert!(changes.proposal("p", &Proposal::abstain(Reason::Clear)).is_some());
        let decision = DecisionHeader { mode: Mode::CriticalSilent.code(), ..Default::default() };
        let lines = changes.decision("d", &decision, &[]);
        assert_eq!((lines.len(), lines[0].message.as_str()), (1, "critical behavior or sensor silent"));
        assert!(changes.decision("d", &decision, &[]).is_empty());
    }
}
