//! Events of a run.

use yamabico_core::time::Time;

/// Maximum number of events that are kept.
const MAX_EVENTS: usize = 2000;

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Event {
    /// Time.
    pub at: Time,
    /// Kind.
    pub kind: EventKind,
    /// Sentence without its time.
    pub text: String,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum EventKind {
    /// Another behavior took control.
    HandOver,
    /// A process ended, or a plugin failed.
    Failure,
}

/// Events in the order of time, up to [`MAX_EVENTS`].
#[derive(Clone, Debug, Default)]
pub(super) struct Events {
    kept: Vec<Event>,
    omitted: u64,
}

impl Events {
    /// Adds an event.
    pub fn add(&mut self, at: Time, kind: EventKind, text: String) {
        if self.kept.len() < MAX_EVENTS {
            self.kept.push(Event { at, kind, text });
        } else {
            self.omitted += 1;
        }
    }

    /// Kept events, and the number of those that found no room.
    pub fn kept(&self) -> (&[Event], u64) {
        (&self.kept, self.omitted)
    }
}
