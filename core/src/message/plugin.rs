//! What plugins tell of themselves.

use super::{Name, Note, item, message, vocabulary};

vocabulary! {
    /// How a plugin fares.
    pub enum PluginState {
        /// Coming up.
        Starting = 0 "starting",
        /// Doing its work.
        Running = 1 "running",
        /// Not asked, since another behavior inhibits it.
        Sleeping = 2 "sleeping",
        /// Switched off.
        Disabled = 3 "disabled",
        /// Out for good.
        Failed = 4 "failed",
        /// Its sensors have nothing more to measure.
        Ended = 5 "ended",
    }
}

message! {
    /// A plugin is alive.
    "yamabico.Heartbeat.v1" Stream [u8]
    pub struct Heartbeat {
        /// When it was sent.
        pub stamp_ns: u64,
        /// Counts up by one a heartbeat.
        pub sequence: u64,
        /// Who is alive.
        pub plugin: Name,
        /// A [`PluginState`] code.
        pub state: u32,
        /// Times that it was started again.
        pub restarts: u32,
    }
}

impl Heartbeat {
    /// How the plugin fares, where the code is known.
    pub fn state(&self) -> Option<PluginState> {
        PluginState::from_code(self.state)
    }
}

message! {
    /// A plugin cannot do what it should. Its items are the reason in words, UTF-8.
    "yamabico.FailureHeader.v1" Stream [u8] in words
    pub struct FailureHeader {
        /// When it failed.
        pub stamp_ns: u64,
        /// Counts up by one a failure.
        pub sequence: u64,
        /// Who failed.
        pub plugin: Name,
        /// The key of its table to change, dotted; empty where none is to blame.
        pub key: Note,
    }
}

message! {
    /// How the calls of a behavior went since it was started. Wall-clock figures; the calls by duration follow.
    "yamabico.CallsHeader.v1" Latest [CallBucket]
    pub struct CallsHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a report.
        pub sequence: u64,
        /// Whose calls.
        pub plugin: Name,
        /// The longest call, ns.
        pub longest_ns: u64,
        /// Calls that were longer than the budget.
        pub overruns: u64,
        /// Calls that proposed nothing.
        pub abstentions: u64,
        /// Calls that panicked.
        pub panics: u32,
        /// Times that it had been started again: each start counts anew.
        pub restarts: u32,
    }
}

item! {
    /// Calls of about the same duration.
    pub struct CallBucket {
        /// Which bucket of the scale: below 32 so many ns; above, 32 equal steps to each doubling.
        pub index: u32,
        /// How many calls.
        pub calls: u32,
    }
}

message! {
    /// What the successor of a behavior must know to go on where that stopped. Its items are JSON.
    "yamabico.MemoryHeader.v1" Latest [u8] in words
    pub struct MemoryHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Whose memory.
        pub plugin: Name,
    }
}

vocabulary! {
    /// What the supervisor does with a plugin's process.
    pub enum ProcessState {
        /// It has none, and is to be started.
        Due = 0 "waits to be started",
        /// It comes up.
        ComingUp = 1 "coming up",
        /// It is up.
        Up = 2 "up",
        /// It has ended for good.
        Ended = 3 "ended",
    }
}

message! {
    /// The processes of the plugins that have one, told whenever something changed.
    "yamabico.ProcessesHeader.v2" Latest [Process]
    pub struct ProcessesHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
    }
}

item! {
    /// The process of one plugin.
    pub struct Process {
        /// Whose.
        pub plugin: Name,
        /// How its last process ended, in words; empty where none has.
        pub ended: Note,
        /// What it last said went wrong, the beginning; empty where nothing did.
        pub said: Note,
        /// When the last process ended.
        pub ended_ns: u64,
        /// When it said what went wrong.
        pub said_ns: u64,
        /// When the next one is started; zero where one runs.
        pub due_ns: u64,
        /// Its number; zero where there is none.
        pub pid: u32,
        /// A [`ProcessState`] code.
        pub state: u32,
        /// Times that it was started again.
        pub restarts: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Process {
    /// What the supervisor does with it, where the code is known.
    pub fn state(&self) -> Option<ProcessState> {
        ProcessState::from_code(self.state)
    }
}

message! {
    /// Who works on the robot and what they tell each other, once for those who join it. Its items are JSON.
    "yamabico.RosterHeader.v1" Latest [u8] in words
    pub struct RosterHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
    }
}

message! {
    /// Walls that a device knows, for plots: polylines on the floor.
    "yamabico.WallsHeader.v1" Latest [WallPoint]
    pub struct WallsHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Who knows.
        pub device: Name,
    }
}

item! {
    /// A corner of a wall.
    pub struct WallPoint {
        /// Map frame, meters.
        pub x: f64,
        /// Map frame, meters.
        pub y: f64,
        /// Corners of one line follow each other and share its number.
        pub line: u64,
    }
}
