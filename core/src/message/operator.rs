//! What an operator asks of behaviors.

use super::{Name, Note, message, vocabulary};

vocabulary! {
    /// How far a change of parameters is.
    pub enum RetuneStep {
        /// Build what the new parameters make, beside what works.
        Prepare = 1 "prepare",
        /// Let it work.
        Apply = 2 "apply",
        /// Forget it.
        Drop = 3 "drop",
    }
}

message! {
    /// The robot asks a behavior to change its parameters. Its items are all of them, TOML.
    "yamabico.RetuneHeader.v1" Stream [u8] in words
    pub struct RetuneHeader {
        /// When it was asked.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Which change: every step of one has the same number.
        pub request: u64,
        /// Who is to change.
        pub behavior: Name,
        /// A [`RetuneStep`] code.
        pub step: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl RetuneHeader {
    /// How far the change is, where the code is known.
    pub fn step(&self) -> Option<RetuneStep> {
        RetuneStep::from_code(self.step)
    }
}

vocabulary! {
    /// What became of a change of parameters.
    pub enum Retuning {
        /// What they make is built and waits.
        Ready = 1 "ready",
        /// They do not do; the old ones stay.
        Refused = 2 "refused",
        /// They are in force.
        Applied = 3 "applied",
    }
}

message! {
    /// What became of a change of parameters. Its items are words.
    "yamabico.RetunedHeader.v1" Stream [u8] in words
    pub struct RetunedHeader {
        /// When it was told.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Which change; of the robot's own answer, the stamp of what was asked.
        pub request: u64,
        /// Who answers; empty where the robot for all of them.
        pub behavior: Name,
        /// The key to change, dotted; empty where none is to blame.
        pub key: Note,
        /// A [`Retuning`] code.
        pub outcome: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl RetunedHeader {
    /// What became of it, where the code is known.
    pub fn outcome(&self) -> Option<Retuning> {
        Retuning::from_code(self.outcome)
    }
}

message! {
    /// Where somebody holds the stick that drives the robot by hand: shares of the largest speeds.
    "yamabico.Stick.v1" Latest [u8]
    pub struct Stick {
        /// When it was held there.
        pub stamp_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// -1 (backwards) to 1 (forward).
        pub forward: f64,
        /// -1 (to the right) to 1 (to the left).
        pub left: f64,
        /// -1 (clockwise) to 1 (counterclockwise).
        pub turn: f64,
    }
}
