//! Requests of the operator to behaviors, and their responses.

use super::{Name, Note, code_enum, message};

code_enum! {
    /// Step of a two-phase change of parameters.
    pub enum RetuneStep {
        /// Build the behavior with the new parameters while the old one keeps running.
        Prepare = 1 "prepare",
        /// Replace the behavior by the prepared one.
        Apply = 2 "apply",
        /// Discard the prepared behavior.
        Drop = 3 "drop",
    }
}

message! {
    /// Request to a behavior to change its parameters. Its items are the complete parameters, TOML.
    "yamabico.RetuneHeader.v1" Stream [u8] as text
    pub struct RetuneHeader {
        /// Time of the request.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Id of the change, the same in all of its steps.
        pub request: u64,
        /// Name of the behavior.
        pub behavior: Name,
        /// A [`RetuneStep`] code.
        pub step: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl RetuneHeader {
    /// Returns the step, or `None` if the code is undefined.
    pub fn step(&self) -> Option<RetuneStep> {
        RetuneStep::from_code(self.step)
    }
}

code_enum! {
    /// Outcome of one step of a change of parameters.
    pub enum RetuneOutcome {
        /// The prepared behavior is ready.
        Ready = 1 "ready",
        /// The parameters were refused; the old ones stay in force.
        Refused = 2 "refused",
        /// The parameters are in force.
        Applied = 3 "applied",
    }
}

message! {
    /// Response to a change of parameters. Its items are the error text.
    "yamabico.RetunedHeader.v1" Stream [u8] as text
    pub struct RetunedHeader {
        /// Time of the response.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Id of the change; in the robot's response to the operator, the stamp of the operator's request.
        pub request: u64,
        /// Name of the responding behavior; empty if the robot responds for all of them.
        pub behavior: Name,
        /// Dotted path of the parameter to change; empty if no parameter is the cause.
        pub key: Note,
        /// A [`RetuneOutcome`] code.
        pub outcome: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl RetunedHeader {
    /// Returns the outcome, or `None` if the code is undefined.
    pub fn outcome(&self) -> Option<RetuneOutcome> {
        RetuneOutcome::from_code(self.outcome)
    }
}

message! {
    /// Position of the operator's joystick, as fractions of the maximum speeds.
    "yamabico.Stick.v1" Latest [u8]
    pub struct Stick {
        /// Time of the reading.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Forward speed: -1 (backward) to 1 (forward).
        pub forward: f64,
        /// Lateral speed: -1 (right) to 1 (left).
        pub left: f64,
        /// Turn rate: -1 (clockwise) to 1 (counterclockwise).
        pub turn: f64,
    }
}
