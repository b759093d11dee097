//! Arbitration policy of one task on one robot.

use std::time::Duration;

use yamabico_core::message::{Axes, Axis, Name};
use yamabico_core::sensor::MotionLimits;

use crate::kinematics::Kinematics;

/// Everything that [`decide`](crate::decide::decide) depends on and that does not change during a run.
///
/// A behavior is identified by its index in `behaviors`: proposals, verdicts and wires all use that index.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// Behaviors in any order; only priorities rank them.
    pub behaviors: Vec<BehaviorPolicy>,
    /// Inhibition and suppression between behaviors.
    pub wires: Vec<Wire>,
    /// Sensors without which the robot must not move.
    pub sensors: Vec<CriticalSensor>,
    /// Rule for equal priorities.
    pub ties: TieRule,
    /// Speeds, accelerations and jerks that the robot may reach.
    pub limits: MotionLimits,
    /// Kinematics of the drive.
    pub kinematics: Kinematics,
    /// Rate of the keep-alive tick, Hz; proposals may trigger more decisions.
    pub rate_hz: f64,
    /// Maximum time by which a stamp may lie in the future.
    pub future_tolerance: Duration,
    /// Consequence of sensor data that is older than a latency budget.
    pub latency_policy: LatencyPolicy,
}

impl Policy {
    /// A strict policy at 50 Hz without wires or critical sensors; stamps may lie 2 ms in the future.
    pub fn new(limits: MotionLimits, kinematics: Kinematics, behaviors: Vec<BehaviorPolicy>) -> Policy {
        Policy {
            behaviors,
            wires: Vec::new(),
            sensors: Vec::new(),
            ties: TieRule::Strict,
            limits,
            kinematics,
            rate_hz: 50.0,
            future_tolerance: Duration::from_millis(2),
            latency_policy: LatencyPolicy::Count,
        }
    }

    /// Axes of the drive.
    pub fn axes(&self) -> Axes {
        self.kinematics.axes()
    }

    /// Maximum speed along `axis`, m/s or rad/s; zero if the drive lacks the axis.
    pub fn speed(&self, axis: Axis) -> f64 {
        if self.axes().contains(axis) { self.limits.speed[axis as usize] } else { 0.0 }
    }

    /// Index of the behavior called `name`.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.behaviors.iter().position(|behavior| behavior.name.as_str() == name)
    }

    /// Name of the behavior at `index`; empty for `None`.
    pub fn name(&self, index: Option<u16>) -> Name {
        index.and_then(|i| self.behaviors.get(usize::from(i))).map(|b| b.name).unwrap_or_default()
    }
}

/// Arbitration settings of one behavior.
#[derive(Clone, Debug, PartialEq)]
pub struct BehaviorPolicy {
    /// Name in the task file, unique.
    pub name: Name,
    /// Priority; the higher one wins.
    pub priority: i32,
    /// Set if the robot must not move without it.
    pub critical: bool,
    /// Set if it is enabled at the start.
    pub enabled: bool,
    /// Maximum silence if it is critical; a longer one stops the robot.
    pub deadline: Duration,
    /// Maximum age of a proposal's stamp.
    pub max_age: Duration,
    /// Maximum age of a proposal's evidence.
    pub max_evidence_age: Duration,
    /// Age of its oldest sensor data above which a command counts as late.
    pub latency_budget: Option<Duration>,
    /// Set if it stops proposing while it is inhibited.
    pub sleeps: bool,
    /// Minimum duration of a halt, and time for which a halt or limit outlives its silent author.
    pub hold: Duration,
    /// Time for which lower priorities wait before they take over an axis that it drove.
    pub dwell: Duration,
}

impl BehaviorPolicy {
    /// A behavior that is not critical, with the default settings: maximum ages of 200 ms (stamp) and 1 s (evidence), 500 ms
    /// of hold, a deadline of 300 ms and no dwell.
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
}

/// Effect of a wire on the drive proposals of its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireKind {
    /// They are ignored.
    Inhibit,
    /// They are ignored on the axes that the source claims or last claimed.
    Suppress,
}

/// Keeps behavior `what` from driving while behavior `by` is active, and `hold` after that. Halts and limits pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// Effect: on every axis, or only on those that `by` claims.
    pub kind: WireKind,
    /// Index of the source.
    pub by: usize,
    /// Index of the target.
    pub what: usize,
    /// Time for which it outlasts the activity of `by`; [`Duration::MAX`] is forever.
    pub hold: Duration,
}

impl Wire {
    /// A wire that keeps `what` from driving.
    pub fn inhibit(by: usize, what: usize, hold: Duration) -> Wire {
        Wire { kind: WireKind::Inhibit, by, what, hold }
    }

    /// A wire that keeps `what` from driving on the axes that `by` claims.
    pub fn suppress(by: usize, what: usize, hold: Duration) -> Wire {
        Wire { kind: WireKind::Suppress, by, what, hold }
    }
}

/// A sensor without which the robot must not move.
#[derive(Clone, Debug, PartialEq)]
pub struct CriticalSensor {
    /// Name in the robot file.
    pub name: Name,
    /// Maximum age of the newest measurement; an older one stops the robot.
    pub max_age: Duration,
}

/// Rule for equal priorities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum TieRule {
    /// Equal priorities are a configuration error; if it occurs nevertheless, the name that sorts first wins.
    #[default]
    Strict,
    /// Proposals are averaged on each axis, weighted by confidence.
    Blend,
}

/// Consequence of a command that rests on data older than its latency budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum LatencyPolicy {
    /// Late commands are counted and reported.
    #[default]
    Count,
    /// Late commands also slow the robot, to the share `budget / age` of its maximum speeds.
    Slow,
}
