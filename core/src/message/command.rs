//! Commands and decisions of the arbiter, and the operator's requests.

use super::{Axes, Name, Note, Twist, code_enum, item, message};

message! {
    /// Command of the arbiter to the drive.
    "yamabico.Command.v2" Stream [u8] evidence evidence_ns
    pub struct Command {
        /// Time of the decision.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it; the time of the decision if no behavior drives.
        pub evidence_ns: u64,
        /// Time at which the behavior with the oldest data received it. Zero, like the next two, if no behavior drives.
        pub received_ns: u64,
        /// Time at which that behavior sent its proposal.
        pub proposed_ns: u64,
        /// Time at which the arbiter received that proposal.
        pub accepted_ns: u64,
        /// Time at which the command was sent.
        pub sent_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Body twist within the robot's limits.
        pub twist: Twist,
        /// Nonzero to brake with the emergency deceleration.
        pub emergency: u32,
        /// Zero.
        pub reserved: u32,
        /// Behaviors that drive the linear, lateral and angular axis; empty if none.
        pub source: [Name; 3],
    }
}

code_enum! {
    /// State of the arbiter.
    pub enum Mode {
        /// A behavior drives.
        Driving = 0 "driving",
        /// No behavior claims an axis.
        Idle = 1 "idle",
        /// A halt stops at least one axis.
        Halted = 2 "halted",
        /// A critical behavior or sensor is silent.
        CriticalSilent = 3 "critical behavior or sensor silent",
        /// The emergency stop is latched.
        EmergencyStop = 4 "emergency stop",
        /// The run is ending and the robot is being stopped.
        ShuttingDown = 5 "shutting down",
    }
}

message! {
    /// A decision of the arbiter with its explanation. Its items are the verdicts on the behaviors.
    "yamabico.DecisionHeader.v3" Stream [Verdict] evidence evidence_ns
    pub struct DecisionHeader {
        /// Time of the decision.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind the command.
        pub evidence_ns: u64,
        /// Sequence number of the command.
        pub sequence: u64,
        /// Twist that the winning behaviors propose, before limits and ramps.
        pub wanted: Twist,
        /// The same after the robot's speed limits and the kinematics of its drive.
        pub feasible: Twist,
        /// Lowest limit in force on each axis; valid for axes with a `limiter`.
        pub limit: Twist,
        /// Twist after halts and limits, before ramps.
        pub allowed: Twist,
        /// Commanded twist.
        pub commanded: Twist,
        /// Twist that would be `wanted` without halts: that of a coupled drive that gave up because a halt stops one of its axes.
        pub wished: Twist,
        /// Axes that a halt stops.
        pub halted: Axes,
        /// Axes that the drive can move.
        pub axes: Axes,
        /// A [`Mode`] code.
        pub mode: u32,
        /// Nonzero if an axis brakes with the emergency deceleration.
        pub emergency: u32,
        /// Behaviors that drive the linear, lateral and angular axis; empty if none.
        pub source: [Name; 3],
        /// Behaviors whose limits bind the axes; empty if none.
        pub limiter: [Name; 3],
        /// Behaviors that halt the axes; empty if none.
        pub halter: [Name; 3],
        /// Explanation of the mode.
        pub note: Note,
    }
}

impl DecisionHeader {
    /// Returns the mode, or `None` if the code is undefined.
    pub fn mode(&self) -> Option<Mode> {
        Mode::from_code(self.mode)
    }
}

code_enum! {
    /// Outcome of a proposal in a decision.
    pub enum Outcome {
        /// No proposal has arrived yet.
        Silent = 0 "silent",
        /// The behavior abstained.
        Abstained = 1 "abstained",
        /// It drives every axis that it claims.
        Won = 2 "won",
        /// It drives some of the axes that it claims.
        WonPart = 3 "won in part",
        /// Blended with proposals of the same priority.
        Blended = 4 "blended",
        /// Its limit is in force.
        Limiting = 5 "limiting",
        /// Its limit applies to other directions.
        LimitElsewhere = 6 "limit points elsewhere",
        /// Its halt is in force.
        Halting = 7 "halting",
        /// Its halt or limit is held after its author fell silent or released it.
        Held = 8 "held",
        /// The behavior is disabled.
        Disabled = 20 "disabled",
        /// The proposal is too old.
        Stale = 21 "stale",
        /// The sensor data behind it is too old.
        StaleEvidence = 22 "stale evidence",
        /// Stamped in the future.
        FromTheFuture = 23 "from the future",
        /// Not finite, out of range, or with an undefined code.
        Malformed = 24 "malformed",
        /// Inhibited by another behavior.
        Inhibited = 25 "inhibited",
        /// Suppressed by another behavior on every axis that it claims.
        Suppressed = 26 "suppressed",
        /// A higher priority drives every axis that it claims.
        Outranked = 27 "outranked",
        /// Coupled: it lost one axis and gave up the others.
        GaveUp = 28 "gave up, coupled",
        /// Waiting for its dwell time before it takes over from a higher priority.
        Waiting = 29 "waiting",
        /// A halt stops every axis that it won.
        Stopped = 30 "stopped by a halt",
    }
}

item! {
    /// Verdict of a decision on one behavior.
    pub struct Verdict {
        /// Name of the behavior.
        pub behavior: Name,
        /// Behavior that outranked, inhibited, suppressed or halted it; empty if none.
        pub by: Name,
        /// Priority from the task file.
        pub priority: i32,
        /// An [`Outcome`] code.
        pub outcome: u32,
        /// Axes that it claims, limits or halts.
        pub claimed: Axes,
        /// Axes that it drives.
        pub won: Axes,
        /// Number behind the outcome: the age in s, the limit in m/s or rad/s, or zero.
        pub number: f64,
        /// [`Reason`](super::Reason) code of its proposal.
        pub reason: u32,
        /// A [`Kind`](super::Kind) code.
        pub kind: u32,
        /// Remaining time of a hold, inhibition, suppression or wait without new messages, s; negative if it lasts
        /// until the author returns, zero for other outcomes.
        pub left_s: f64,
        /// Fault of its newest proposal, an [`Outcome`] code, even if its halt or limit is still in force; zero if
        /// none.
        pub fault: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Verdict {
    /// Returns the outcome, or `None` if the code is undefined.
    pub fn outcome(&self) -> Option<Outcome> {
        Outcome::from_code(self.outcome)
    }
}

code_enum! {
    /// Kind of an operator's request.
    pub enum ControlKind {
        /// Enable a behavior.
        Enable = 1 "enable",
        /// Disable a behavior.
        Disable = 2 "disable",
        /// Change parameters: the text is TOML, one table of keys per behavior.
        Retune = 3 "retune",
        /// Latch the emergency stop.
        EmergencyStop = 4 "e-stop",
        /// Release the emergency stop.
        Reset = 5 "reset",
        /// Set the goal.
        Goal = 6 "goal",
    }
}

message! {
    /// An operator's request to a running robot. Its items are the TOML text of a parameter change. A malformed request
    /// is refused and reported.
    "yamabico.Control.v2" Stream [u8] as text
    pub struct Control {
        /// Time of the request.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Name of the behavior; empty for the whole robot.
        pub target: Name,
        /// Explanation by the operator.
        pub note: Note,
        /// Goal: x, y, theta and tolerance in m, m, rad and m.
        pub goal: [f64; 4],
        /// A [`ControlKind`] code.
        pub kind: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Control {
    /// Returns the kind of the request, or `None` if the code is undefined.
    pub fn kind(&self) -> Option<ControlKind> {
        ControlKind::from_code(self.kind)
    }
}
