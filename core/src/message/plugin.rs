//! Status messages of plugins and of their processes.

use super::{Name, Note, code_enum, item, message};

code_enum! {
    /// State of a plugin.
    pub enum PluginState {
        /// Starting.
        Starting = 0 "starting",
        /// Running.
        Running = 1 "running",
        /// Not called, because another behavior inhibits it.
        Sleeping = 2 "sleeping",
        /// Disabled by the operator.
        Disabled = 3 "disabled",
        /// Failed permanently.
        Failed = 4 "failed",
        /// Its sensors have no more data.
        Ended = 5 "ended",
    }
}

message! {
    /// Heartbeat of a plugin.
    "yamabico.Heartbeat.v1" Stream [u8]
    pub struct Heartbeat {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the plugin.
        pub plugin: Name,
        /// A [`PluginState`] code.
        pub state: u32,
        /// Number of restarts.
        pub restarts: u32,
    }
}

impl Heartbeat {
    /// Returns the state, or `None` if the code is undefined.
    pub fn state(&self) -> Option<PluginState> {
        PluginState::from_code(self.state)
    }
}

message! {
    /// Failure of a plugin. Its items are the error text, UTF-8.
    "yamabico.FailureHeader.v1" Stream [u8] as text
    pub struct FailureHeader {
        /// Time of the failure.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the plugin.
        pub plugin: Name,
        /// Dotted path of the parameter to change; empty if no parameter is the cause.
        pub key: Note,
    }
}

message! {
    /// Statistics of a behavior's calls since its last start, by the wall clock. Its items are a histogram of their
    /// durations.
    "yamabico.CallsHeader.v1" Latest [CallBucket]
    pub struct CallsHeader {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the behavior.
        pub plugin: Name,
        /// Maximum duration of a call, ns.
        pub longest_ns: u64,
        /// Number of calls that exceeded the budget.
        pub overruns: u64,
        /// Number of calls that abstained.
        pub abstentions: u64,
        /// Number of calls that panicked.
        pub panics: u32,
        /// Number of restarts before these calls.
        pub restarts: u32,
    }
}

item! {
    /// One bucket of the histogram of call durations.
    pub struct CallBucket {
        /// Index on a logarithmic scale: below 32, the duration in ns; above, 32 equal steps per doubling.
        pub index: u32,
        /// Number of calls.
        pub calls: u32,
    }
}

message! {
    /// Saved state of a behavior, from which a restarted instance continues. Its items are JSON.
    "yamabico.MemoryHeader.v1" Latest [u8] as text
    pub struct SavedStateHeader {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the behavior.
        pub plugin: Name,
    }
}

code_enum! {
    /// State of a supervised process.
    pub enum ProcessState {
        /// Waiting to be started.
        Waiting = 0 "waiting to start",
        /// Starting.
        Starting = 1 "starting",
        /// Running.
        Running = 2 "running",
        /// Ended permanently.
        Ended = 3 "ended",
    }
}

message! {
    /// State of all supervised processes, sent when it changes. Its items are the processes.
    "yamabico.ProcessesHeader.v2" Latest [Process]
    pub struct ProcessesHeader {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
    }
}

item! {
    /// Process of one plugin.
    pub struct Process {
        /// Name of the plugin.
        pub plugin: Name,
        /// Explanation how the last process ended; empty if none has.
        pub ended: Note,
        /// Beginning of the last failure report; empty if there was none.
        pub failure: Note,
        /// Time at which the last process ended.
        pub ended_ns: u64,
        /// Time of the last failure report.
        pub failed_ns: u64,
        /// Time of the next start; zero while a process is running.
        pub due_ns: u64,
        /// Process id; zero if no process is running.
        pub pid: u32,
        /// A [`ProcessState`] code.
        pub state: u32,
        /// Number of restarts.
        pub restarts: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Process {
    /// Returns the state, or `None` if the code is undefined.
    pub fn state(&self) -> Option<ProcessState> {
        ProcessState::from_code(self.state)
    }
}

message! {
    /// Manifest of the robot for programs that connect to it: plugins, topics and settings. Its items are JSON.
    "yamabico.RosterHeader.v1" Latest [u8] as text
    pub struct RobotManifestHeader {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
    }
}

message! {
    /// Walls known to a simulated device, for plots. Its items are the corners of polylines on the floor.
    "yamabico.WallsHeader.v1" Latest [WallPoint]
    pub struct WallsHeader {
        /// Time of sending.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the device.
        pub device: Name,
    }
}

item! {
    /// A corner of a wall.
    pub struct WallPoint {
        /// Position along x of the map frame, m.
        pub x: f64,
        /// Position along y of the map frame, m.
        pub y: f64,
        /// Index of the polyline that the corner belongs to; its corners follow each other.
        pub line: u64,
    }
}
