//! What a decision remembers of the ones before.

use std::time::Duration;

use yamabico_core::message::{Axes, Twist};
use yamabico_core::time::Time;

use super::contest::Tenure;
use super::hear::Hearing;
use super::restrain::Restraint;
use super::wires::{Line, in_order};
use crate::policy::{Contest, Policy};
use crate::ramp::Ramp;
use crate::safety::{Course, Orders, Watch};

/// The memory of [`decide`](super::decide), and what is ordered from outside: made once from a policy.
///
/// Rows stand in the order in which behaviors are asked: by priority, highest first, then by name.
#[derive(Clone, Debug)]
pub struct State {
    pub(super) rules: Vec<Rule>,
    pub(super) hearings: Vec<Hearing>,
    pub(super) restraints: Vec<Restraint>,
    pub(super) tenures: Vec<Tenure>,
    pub(super) lines: Vec<Line>,
    /// Rows with a dwell.
    pub(super) dwellers: Vec<u16>,
    /// Rows of this decision with a drive proposal to be considered.
    pub(super) drivers: Vec<u16>,
    /// Rows of this decision with a halt or limit in force.
    pub(super) restraining: Vec<u16>,
    /// Slots of critical behaviors.
    pub(super) watches: Vec<(u16, Watch)>,
    sensors: Vec<Watch>,
    pub(super) bounds: Bounds,
    pub(super) has: Axes,
    pub(super) tolerance_ns: u64,
    /// Whether some behavior has a latency budget.
    pub(super) has_budgets: bool,
    pub(super) orders: Orders,
    pub(super) course: Course,
    pub(super) ramp: Ramp,
    sequence: u64,
}

/// What the policy says of one behavior, ready for use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    /// Index in the policy.
    pub slot: u16,
    /// First row of a lower priority; the next one in a strict contest.
    pub group_end: u16,
    pub enabled: bool,
    /// Whether it is silent while it is inhibited.
    pub sleeps: bool,
    /// Index of its watch.
    pub watch: Option<u16>,
    /// First row of the same priority; the row itself in a strict contest.
    pub group_start: u16,
    pub max_age_ns: u64,
    pub max_evidence_age_ns: u64,
    pub hold_ns: u64,
    pub dwell_ns: u64,
}

/// As nanoseconds; what is longer than the clock can count becomes for ever.
pub(super) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// What a drive proposal may ask for: twice the robot's limits, for each set of claimed axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds([Twist; 8]);

impl Bounds {
    fn new(policy: &Policy) -> Bounds {
        Bounds(std::array::from_fn(|bits| {
            let claimed = Axes::from_bits(bits as u32).unwrap_or_default().intersection(policy.axes());
            let mut bound = Twist { linear: f64::MAX, lateral: f64::MAX, angular: f64::MAX };
            for axis in claimed.iter() {
                bound.set(axis, 2.0 * policy.speed(axis));
            }
            bound
        }))
    }

    /// The bound for valid `axes`.
    pub fn of(&self, axes: Axes) -> &Twist {
        &self.0[(axes.bits() & 7) as usize]
    }
}

impl State {
    /// A robot at rest that has heard nothing yet.
    pub fn new(policy: &Policy) -> State {
        let behaviors = &policy.behaviors;
        let mut order: Vec<usize> = (0..behaviors.len()).collect();
        order.sort_by_key(|&slot| (std::cmp::Reverse(behaviors[slot].priority), behaviors[slot].name));
        let row_of = |slot: usize| order.iter().position(|&s| s == slot);

        let mut watches = Vec::new();
        let rules: Vec<Rule> = order
            .iter()
            .enumerate()
            .map(|(row, &slot)| {
                let behavior = &behaviors[slot];
                let lower = order[row..].iter().position(|&s| behaviors[s].priority < behavior.priority);
                let first = order.iter().position(|&s| behaviors[s].priority == behavior.priority);
                let (group_start, group_end) = match policy.contest {
                    Contest::Strict => (row, row + 1),
                    Contest::Blend => (first.unwrap_or(row), lower.map_or(order.len(), |n| row + n)),
                };
                let watch = behavior.critical.then(|| {
                    watches.push((slot as u16, Watch::new(behavior.deadline)));
                    (watches.len() - 1) as u16
                });
                Rule {
                    slot: slot as u16,
                    group_start: group_start as u16,
                    group_end: group_end as u16,
                    enabled: behavior.enabled,
                    sleeps: behavior.sleeps,
                    watch,
                    max_age_ns: nanoseconds(behavior.max_age),
                    max_evidence_age_ns: nanoseconds(behavior.max_evidence_age),
                    hold_ns: nanoseconds(behavior.hold),
                    dwell_ns: nanoseconds(behavior.dwell),
                }
            })
            .collect();
        let lines = policy
            .wires
            .iter()
            .filter_map(|wire| Some(Line::new(wire, row_of(wire.by)?, row_of(wire.what)?)))
            .collect();
        let n = rules.len();
        let dwellers = (0..n).filter(|&row| rules[row].dwell_ns > 0).map(|row| row as u16).collect();
        State {
            dwellers,
            rules,
            hearings: vec![Hearing::default(); n],
            restraints: vec![Restraint::default(); n],
            tenures: vec![Tenure::default(); n],
            lines: in_order(lines),
            drivers: Vec::with_capacity(n),
            restraining: Vec::with_capacity(n),
            watches,
            sensors: policy.sensors.iter().map(|sensor| Watch::new(sensor.max_age)).collect(),
            bounds: Bounds::new(policy),
            has: policy.axes(),
            tolerance_ns: nanoseconds(policy.future_tolerance),
            has_budgets: behaviors.iter().any(|behavior| behavior.latency_budget.is_some()),
            orders: Orders::default(),
            course: Course::default(),
            ramp: Ramp::default(),
            sequence: 0,
        }
    }

    /// Latches the emergency stop.
    pub fn emergency_stop(&mut self) {
        self.orders.stop();
    }

    /// Releases the emergency stop.
    pub fn reset(&mut self) {
        self.orders.reset();
    }

    /// Brings the robot to rest for the end of the run.
    pub fn shut_down(&mut self) {
        self.orders.shut_down();
    }

    /// Lets the behavior at `index` of the policy be heard.
    pub fn enable(&mut self, index: usize) {
        self.rules
            .iter_mut()
            .filter(|rule| usize::from(rule.slot) == index)
            .for_each(|rule| rule.enabled = true);
    }

    /// Lets the behavior at `index` of the policy not be heard. A halt or limit of it is held as if it had died; a critical
    /// one counts as silent.
    pub fn disable(&mut self, index: usize) {
        self.rules
            .iter_mut()
            .filter(|rule| usize::from(rule.slot) == index)
            .for_each(|rule| rule.enabled = false);
    }

    /// The critical sensor at `index` of the policy measured at `stamp`.
    pub fn sensor_measured(&mut self, index: usize, stamp: Time) {
        if let Some(watch) = self.sensors.get_mut(index) {
            watch.hear(stamp);
        }
    }

    /// The motion commanded last.
    pub fn commanded(&self) -> Twist {
        self.ramp.velocity()
    }

    pub(super) fn next_sequence(&mut self) -> u64 {
        self.sequence = self.sequence.wrapping_add(1);
        self.sequence
    }

    /// The first critical behavior, or else sensor, that is silent.
    pub(super) fn silent_part(&self, now: Time) -> Option<crate::safety::Stop> {
        use crate::safety::Stop;
        let behavior =
            self.watches.iter().find(|(_, watch)| watch.is_silent(now, Duration::MAX)).map(|&(slot, _)| slot);
        let sensor = || {
            self.sensors
                .iter()
                .position(|watch| watch.is_silent(now, Duration::from_nanos(self.tolerance_ns)))
        };
        behavior.map(Stop::Behavior).or_else(|| sensor().map(|index| Stop::Sensor(index as u16)))
    }
}
