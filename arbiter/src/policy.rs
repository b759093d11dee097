//! The arbitration table of one task on one robot, as it stands in memory.

use std::time::Duration;

use yamabico_core::message::{Axes, Axis, Name};
use yamabico_core::sensor::MotionLimits;

use crate::kinematics::Kinematics;

/// Everything that [`decide`](crate::decide::decide) goes by and that does not change while it runs.
///
/// Behaviors are named by their index in `behaviors`; slots of proposals, verdicts and wires all use that index.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// The behaviors, in any order; priorities alone rank them.
    pub behaviors: Vec<BehaviorPolicy>,
    /// Who keeps whom from driving.
    pub wires: Vec<Wire>,
    /// Sensors without which the robot must not move.
    pub sensors: Vec<CriticalSensor>,
    /// What equal priorities mean.
    pub contest: Contest,
    /// What the robot may do.
    pub limits: MotionLimits,
    /// How its drive moves it.
    pub kinematics: Kinematics,
    /// Rate of the keep-alive tick, Hz; decisions may come faster.
    pub rate_hz: f64,
    /// How far ahead of the decision a stamp may lie.
    pub future_tolerance: Duration,
    /// What comes of commands that rest on data older than a latency budget.
    pub lateness: Lateness,
}

impl Policy {
    /// A strict policy at 50 Hz, without wires and critical sensors, that allows stamps 2 ms ahead.
    pub fn new(limits: MotionLimits, kinematics: Kinematics, behaviors: Vec<BehaviorPolicy>) -> Policy {
        Policy {
            behaviors,
            wires: Vec::new(),
            sensors: Vec::new(),
            contest: Contest::Strict,
            limits,
            kinematics,
            rate_hz: 50.0,
            future_tolerance: Duration::from_millis(2),
            lateness: Lateness::Counts,
        }
    }

    /// The axes that the drive has.
    pub fn axes(&self) -> Axes {
        self.kinematics.axes()
    }

    /// Largest speed along `axis`: m/s or rad/s, zero where the drive has no such axis.
    pub fn speed(&self, axis: Axis) -> f64 {
        if self.axes().contains(axis) { self.limits.speed[axis as usize] } else { 0.0 }
    }

    /// The index of the behavior of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.behaviors.iter().position(|behavior| behavior.name.as_str() == name)
    }

    /// The name of the behavior at `index`; empty for nobody.
    pub fn name(&self, index: Option<u16>) -> Name {
        index.and_then(|i| self.behaviors.get(usize::from(i))).map(|b| b.name).unwrap_or_default()
    }
}

/// How one behavior is heard.
#[derive(Clone, Debug, PartialEq)]
pub struct BehaviorPolicy {
    /// Its name in the task file, unique.
    pub name: Name,
    /// Higher wins.
    pub priority: i32,
    /// Whether the robot must not move without it.
    pub critical: bool,
    /// Whether it is heard at the start.
    pub enabled: bool,
    /// A critical one silent for longer stops the robot.
    pub deadline: Duration,
    /// Oldest stamp that is heard.
    pub max_age: Duration,
    /// Oldest evidence that is heard.
    pub max_evidence_age: Duration,
    /// Age of its oldest sensor data above which a command of it counts as late.
    pub latency_budget: Option<Duration>,
    /// Whether it is silent while it is inhibited, which then tells it that it may be.
    pub sleeps: bool,
    /// A halt lasts at least this long, and a halt or limit outlives its silent author by this.
    pub hold: Duration,
    /// Lower priorities wait this long before they take over an axis that it drove.
    pub dwell: Duration,
}

impl BehaviorPolicy {
    /// One that is not critical and has the usual ages: stamps of 200 ms, evidence of 1 s, 500 ms of
    /// hold, a deadline of 300 ms and no dwell.
    pub fn new(name: &str, priority: i32) -> BehaviorPolicy {
        BehaviorPolicy {
            name: Name::new(name),
            priority,
            critical: false,
            enabled: true,
            deadline: Duration::from_millis(300),
            max_age: Duration::from_millis(200),
            max_evidence_age: Duration::from_secs(1),
            latency_budget: None,
            sleeps: false,
            hold: Duration::from_millis(500),
            dwell: Duration::ZERO,
        }
    }

    /// The same, critical.
    pub fn critical(self) -> BehaviorPolicy {
        BehaviorPolicy { critical: true, ..self }
    }

    /// The same with another hold.
    pub fn with_hold(self, hold: Duration) -> BehaviorPolicy {
        BehaviorPolicy { hold, ..self }
    }

    /// The same with another dwell.
    pub fn with_dwell(self, dwell: Duration) -> BehaviorPolicy {
        BehaviorPolicy { dwell, ..self }
    }
}

/// What a wire does to the drive proposals of the behavior at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireKind {
    /// They are not heard at all.
    Inhibit,
    /// They are not heard on the axes that the other claims or last claimed.
    Suppress,
}

/// While behavior `by` is active, and `hold` after, behavior `what` does not drive. Halts and limits pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// On every axis or on those that `by` claims.
    pub kind: WireKind,
    /// Index of the behavior at the start.
    pub by: usize,
    /// Index of the behavior at the end.
    pub what: usize,
    /// How long it outlives the activity of `by`; [`Duration::MAX`] is for ever.
    pub hold: Duration,
}

impl Wire {
    /// `by` keeps `what` from driving.
    pub fn inhibit(by: usize, what: usize, hold: Duration) -> Wire {
        Wire { kind: WireKind::Inhibit, by, what, hold }
    }

    /// `by` keeps `what` from driving on the axes that `by` claims.
    pub fn suppress(by: usize, what: usize, hold: Duration) -> Wire {
        Wire { kind: WireKind::Suppress, by, what, hold }
    }
}

/// A sensor without which the robot must not move.
#[derive(Clone, Debug, PartialEq)]
pub struct CriticalSensor {
    /// Its name in the robot file.
    pub name: Name,
    /// Oldest measurement with which the robot still moves.
    pub max_age: Duration,
}

/// What equal priorities mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Contest {
    /// A mistake; should it stand nevertheless, the name that sorts first wins.
    #[default]
    Strict,
    /// Their proposals are averaged for each axis, weighted by confidence.
    Blend,
}

/// What comes of a command that rests on data older than its latency budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Lateness {
    /// It is counted and told.
    #[default]
    Counts,
    /// It slows the robot, too: to the share of its largest speeds that the budget has in the age.
    Slows,
}
