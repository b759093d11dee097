//! Commands of clients.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use serde::Deserialize;
use serde_json::Value as Json;
use tokio::sync::oneshot;

use crate::model::EventKind;

/// Maximum number of waiting commands; more are refused.
const MAX_WAITING: usize = 16;

/// A command of a client, as JSON such as `{"command": "goto", "x_m": 3, "y_m": 0.5}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Command {
    /// Stop the robot until a reset.
    Estop,
    /// Release the emergency stop.
    Reset,
    /// Enable a behavior.
    Enable {
        /// Name.
        behavior: String,
    },
    /// Disable a behavior.
    Disable {
        /// Name.
        behavior: String,
    },
    /// Send the robot to a point of the map.
    Goto {
        /// X, m.
        x_m: f64,
        /// Y, m.
        y_m: f64,
    },
    /// Change a parameter.
    Set {
        /// Name of the behavior.
        behavior: String,
        /// Key, dotted inside a table.
        key: String,
        /// New value.
        value: Json,
    },
    /// Save the last minute as a recording.
    Save,
    /// Play the recording.
    Play {
        /// Pace, times real time.
        pace: f64,
    },
    /// Pause the playback.
    Pause,
    /// Jump to a time of the recording.
    Seek {
        /// Time, s.
        at_s: f64,
    },
    /// Jump to the next or the last event of the recording.
    Jump {
        /// Set for the next event, else the one before.
        forward: bool,
        /// Kind; without it, any.
        kind: Option<EventKind>,
    },
}

/// Line of a worker that carries out commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Line {
    /// Emergency stops, which never wait for other commands.
    Stop,
    /// Other commands for a robot.
    Robot,
    /// Commands for a playback.
    Playback,
}

/// Effect of a command as a sentence, or the cause why it had none.
pub(crate) type Answer = Result<String, String>;

/// A command, and the channel for its answer.
pub(crate) struct Job {
    pub command: Command,
    pub answer: oneshot::Sender<Answer>,
}

/// Sends commands to the workers.
pub(crate) struct Commander {
    lines: Vec<(Line, SyncSender<Job>)>,
}

impl Command {
    /// Worker that carries it out.
    pub fn line(&self) -> Line {
        match self {
            Command::Estop => Line::Stop,
            Command::Play { .. } | Command::Pause | Command::Seek { .. } | Command::Jump { .. } => {
                Line::Playback
            }
            _ => Line::Robot,
        }
    }
}

impl Commander {
    /// Opens these lines; the receivers are in the same order.
    pub fn open<const N: usize>(lines: [Line; N]) -> (Commander, [Receiver<Job>; N]) {
        let mut senders = Vec::new();
        let receivers = lines.map(|line| {
            let (sender, receiver) = sync_channel(MAX_WAITING);
            senders.push((line, sender));
            receiver
        });
        (Commander { lines: senders }, receivers)
    }

    /// Sends a command; the answer comes later.
    ///
    /// # Errors
    /// There is nothing that carries it out, or too many commands are waiting.
    pub fn send(&self, command: Command) -> Result<oneshot::Receiver<Answer>, String> {
        let line = command.line();
        let Some((_, sender)) = self.lines.iter().find(|(known, _)| *known == line) else {
            return Err(match line {
                Line::Playback => "this is a running robot, not a recording".to_owned(),
                Line::Stop | Line::Robot => "this is a recording, not a running robot".to_owned(),
            });
        };
        let (answer, receiver) = oneshot::channel();
        match sender.try_send(Job { command, answer }) {
            Ok(()) => Ok(receiver),
            Err(TrySendError::Full(_)) => Err("too many commands are waiting: try again".to_owned()),
            Err(TrySendError::Disconnected(_)) => Err("the view is ending".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn malformed_commands_are_refused() {
        let parse = |text: &str| serde_json::from_str::<Command>(text);
        assert_eq!(parse(r#"{"command":"estop"}"#).unwrap(), Command::Estop);
        assert_eq!(
            parse(r#"{"command":"goto","x_m":1,"y_m":-2.5}"#).unwrap(),
            Command::Goto { x_m: 1.0, y_m: -2.5 }
        );
        let jump = r#"{"command":"jump","forward":true,"kind":"hand-over"}"#;
        assert_eq!(parse(jump).unwrap(), Command::Jump { forward: true, kind: Some(EventKind::HandOver) });
        for text in ["", "{}", "[]", "1", r#"{"command":"fly"}"#, r#"{"command":"goto","x_m":1}"#, "\u{0}"] {
            assert!(parse(text).is_err(), "{text}");
        }
        assert!(parse(r#"{"command":"seek","at_s":1,"more":2}"#).is_err());
    }

    #[test]
    fn a_full_line_refuses_and_stops_have_their_own() {
        let (commander, [stops, _robot]) = Commander::open([Line::Stop, Line::Robot]);
        let waiting: Vec<_> = (0..MAX_WAITING).map(|_| commander.send(Command::Reset).unwrap()).collect();
        assert!(commander.send(Command::Reset).unwrap_err().contains("too many"));
        assert!(commander.send(Command::Estop).is_ok());
        assert_eq!(stops.try_recv().unwrap().command, Command::Estop);
        assert!(commander.send(Command::Pause).unwrap_err().contains("not a recording"));
        assert_eq!(waiting.len(), MAX_WAITING);
    }
}
