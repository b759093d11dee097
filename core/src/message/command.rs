//! What the arbiter decides, and what is asked of it.

use super::{Axes, Name, Note, Twist, item, message, vocabulary};

message! {
    /// What the motors get.
    "yamabico.Command.v2" Stream [u8] evidence evidence_ns
    pub struct Command {
        /// When it was decided.
        pub stamp_ns: u64,
        /// Oldest sensor data behind it; the stamp itself where nothing was claimed.
        pub evidence_ns: u64,
        /// When the behavior with the oldest data was handed it; this and the next two are zero where nothing was claimed.
        pub received_ns: u64,
        /// When that behavior's proposal was sent.
        pub proposed_ns: u64,
        /// When the arbiter took that proposal in.
        pub heard_ns: u64,
        /// When it was sent.
        pub sent_ns: u64,
        /// Counts up by one a command.
        pub sequence: u64,
        /// Body twist, within the robot's limits.
        pub twist: Twist,
        /// Not zero: brake with the emergency deceleration.
        pub emergency: u32,
        /// Zero.
        pub reserved: u32,
        /// Who won the linear, lateral and angular axis; empty where nobody claimed it.
        pub source: [Name; 3],
    }
}

vocabulary! {
    /// The arbiter's state at a decision.
    pub enum Mode {
        /// Some behavior drives.
        Driving = 0 "driving",
        /// Nobody claims an axis.
        Idle = 1 "idle",
        /// A halt stops at least one axis.
        Halted = 2 "halted",
        /// A critical behavior or sensor is silent.
        CriticalSilent = 3 "critical part silent",
        /// The emergency stop is latched.
        EmergencyStop = 4 "emergency stop",
        /// The run ends and the robot is being stopped.
        ShuttingDown = 5 "shutting down",
    }
}

message! {
    /// A decision and why: a verdict on each behavior follows.
    "yamabico.DecisionHeader.v2" Stream [Verdict] evidence evidence_ns
    pub struct DecisionHeader {
        /// When it was decided.
        pub stamp_ns: u64,
        /// Oldest sensor data behind the command.
        pub evidence_ns: u64,
        /// That of the command.
        pub sequence: u64,
        /// What the winners asked for, before limits and ramps.
        pub wanted: Twist,
        /// What the robot's largest speeds and its drive leave of it.
        pub feasible: Twist,
        /// The least limit in force on each axis, where it has a `limiter`.
        pub limit: Twist,
        /// After halts and limits, before ramps.
        pub allowed: Twist,
        /// What was commanded.
        pub commanded: Twist,
        /// Axes that a halt stops.
        pub halted: Axes,
        /// The axes that the drive has.
        pub axes: Axes,
        /// A [`Mode`] code.
        pub mode: u32,
        /// Not zero: some axis brakes with the emergency deceleration.
        pub emergency: u32,
        /// Who won the linear, lateral and angular axis; empty where nobody claimed it.
        pub source: [Name; 3],
        /// Whose limit binds each axis; empty where nobody's.
        pub limiter: [Name; 3],
        /// Who halts each axis; empty where nobody.
        pub halter: [Name; 3],
        /// Why the mode is what it is, in words.
        pub note: Note,
    }
}

impl DecisionHeader {
    /// The mode, where the code is known.
    pub fn mode(&self) -> Option<Mode> {
        Mode::from_code(self.mode)
    }
}

vocabulary! {
    /// What became of a proposal.
    pub enum Outcome {
        /// Nothing has been heard from it yet.
        Silent = 0 "silent",
        /// It abstained.
        Abstained = 1 "abstained",
        /// It drives every axis that it claims.
        Won = 2 "won",
        /// It drives some of the axes that it claims.
        WonPart = 3 "won in part",
        /// Its share is blended with that of equals.
        Blended = 4 "blended",
        /// Its limit is in force.
        Limiting = 5 "limiting",
        /// Its limit is in force only for other directions.
        LimitElsewhere = 6 "limit points elsewhere",
        /// Its halt is in force.
        Halting = 7 "halting",
        /// Its halt or limit is kept though the author fell silent or released it a moment ago.
        Held = 8 "held",
        /// Switched off.
        Disabled = 20 "disabled",
        /// Too old.
        Stale = 21 "stale",
        /// Evidence too old.
        StaleEvidence = 22 "stale evidence",
        /// Stamped later than now.
        FromTheFuture = 23 "from the future",
        /// Not finite, out of range, or not in the vocabulary.
        Malformed = 24 "malformed",
        /// Another behavior inhibits it.
        Inhibited = 25 "inhibited",
        /// Another behavior suppresses it on every axis that it claims.
        Suppressed = 26 "suppressed",
        /// A higher priority has every axis that it claims.
        OutRanked = 27 "out-ranked",
        /// It lost one axis and gave up the others with it.
        GaveUp = 28 "gave up, coupled",
        /// It must wait before it may take over from a higher priority.
        Waiting = 29 "waiting",
        /// A halt stops every axis that it won.
        Stopped = 30 "stopped by a halt",
    }
}

item! {
    /// What became of one behavior in one decision.
    pub struct Verdict {
        /// The behavior.
        pub behavior: Name,
        /// Who beat, inhibited, suppressed or halted it; empty where nobody.
        pub by: Name,
        /// Its priority.
        pub priority: i32,
        /// An [`Outcome`] code.
        pub outcome: u32,
        /// Claimed, limited or halted.
        pub claimed: Axes,
        /// Driven by it in the end.
        pub won: Axes,
        /// The number behind the outcome: age in seconds, the limit, or zero.
        pub number: f64,
        /// The behavior's own [`Reason`](super::Reason) code.
        pub reason: u32,
        /// A [`Kind`](super::Kind) code.
        pub kind: u32,
        /// How long the outcome still lasts if nobody says a word: of what is held, inhibited, suppressed or waits, seconds;
        /// negative where until its author is back, zero elsewhere.
        pub left_s: f64,
        /// What is wrong with its newest word, an [`Outcome`] code, though a halt or limit of it may count all the same; zero
        /// where nothing.
        pub fault: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Verdict {
    /// The outcome, where the code is known.
    pub fn outcome(&self) -> Option<Outcome> {
        Outcome::from_code(self.outcome)
    }
}

vocabulary! {
    /// What somebody asks of a running robot.
    pub enum ControlKind {
        /// Let a behavior be heard.
        Enable = 1 "enable",
        /// Let a behavior not be heard.
        Disable = 2 "disable",
        /// Change parameters: the text is TOML, a table of keys for each behavior.
        Retune = 3 "retune",
        /// Stop, latched.
        EmergencyStop = 4 "e-stop",
        /// Release the latched stop.
        Reset = 5 "reset",
        /// Go to `goal`.
        Goal = 6 "goal",
    }
}

message! {
    /// A request to a running robot. A malformed one is refused and told. Its items are the text of a retune.
    "yamabico.Control.v2" Stream [u8] in words
    pub struct Control {
        /// When it was asked.
        pub stamp_ns: u64,
        /// Counts up by one a request.
        pub sequence: u64,
        /// Whom it concerns; empty where the whole robot.
        pub target: Name,
        /// Why, in words.
        pub note: Note,
        /// x, y, theta and tolerance of a goal: m, m, rad, m.
        pub goal: [f64; 4],
        /// A [`ControlKind`] code.
        pub kind: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Control {
    /// What is asked, where the code is known.
    pub fn kind(&self) -> Option<ControlKind> {
        ControlKind::from_code(self.kind)
    }
}
