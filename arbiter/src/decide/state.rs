//! State that a decision passes on to the next.

use std::time::Duration;

use yamabico_core::message::{Axes, Twist};
use yamabico_core::time::Time;

use super::allocation::DwellTimer;
use super::restraints::Restraint;
use super::screening::Candidate;
use super::wires::{ActiveWire, in_order};
use crate::policy::{Policy, TieRule};
use crate::ramp::Ramp;
use crate::safety::{DecisionClock, Stop, StopRequests, Watchdog};

/// State of [`decide`](super::decide) and the requests from outside. Created once from a policy.
///
/// Its lists have one row for each behavior, by priority, highest first, then by name.
#[derive(Clone, Debug)]
pub struct ArbiterState {
    pub(super) rules: Vec<BehaviorRule>,
    pub(super) candidates: Vec<Candidate>,
    pub(super) restraints: Vec<Restraint>,
    pub(super) dwell_timers: Vec<DwellTimer>,
    pub(super) wires: Vec<ActiveWire>,
    /// Rows with a dwell.
    pub(super) dwelling: Vec<u16>,
    /// Rows of this decision with a drive proposal to consider.
    pub(super) drivers: Vec<u16>,
    /// Rows of this decision with a halt or limit in force.
    pub(super) restraining: Vec<u16>,
    /// Watchdogs of critical behaviors, with their slots.
    pub(super) watchdogs: Vec<(u16, Watchdog)>,
    sensors: Vec<Watchdog>,
    pub(super) bounds: PlausibleSpeeds,
    pub(super) drive_axes: Axes,
    pub(super) tolerance_ns: u64,
    /// Set if a behavior has a latency budget.
    pub(super) has_budgets: bool,
    pub(super) stop_requests: StopRequests,
    pub(super) clock: DecisionClock,
    pub(super) ramp: Ramp,
    sequence: u64,
}

/// Settings of one behavior in the units of a decision.
#[derive(Clone, Copy, Debug)]
pub(super) struct BehaviorRule {
    /// Index in the policy.
    pub slot: u16,
    /// First row of a lower priority; the next row if equal priorities do not share.
    pub group_end: u16,
    pub enabled: bool,
    /// Set if it is silent while it is inhibited.
    pub sleeps: bool,
    /// Index of its watchdog, if it is critical.
    pub watchdog: Option<u16>,
    /// First row of the same priority; the row itself if equal priorities do not share.
    pub group_start: u16,
    pub max_age_ns: u64,
    pub max_evidence_age_ns: u64,
    pub hold_ns: u64,
    pub dwell_ns: u64,
}

/// Nanoseconds of `duration`, saturating at forever.
pub(super) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Plausible speeds of a drive proposal, twice the robot's limits, for each set of claimed axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlausibleSpeeds([Twist; 8]);

impl PlausibleSpeeds {
    fn new(policy: &Policy) -> PlausibleSpeeds {
        PlausibleSpeeds(std::array::from_fn(|bits| {
            let claimed = Axes::from_bits(bits as u32).unwrap_or_default().intersection(policy.axes());
            let mut bound = Twist { linear: f64::MAX, lateral: f64::MAX, angular: f64::MAX };
            for axis in claimed.iter() {
                bound.set(axis, 2.0 * policy.speed(axis));
            }
            bound
        }))
    }

    /// Maximum plausible speeds for valid `axes`.
    pub fn of(&self, axes: Axes) -> &Twist {
        &self.0[(axes.bits() & 7) as usize]
    }
}

impl ArbiterState {
    /// State of a robot at a standstill before the first proposal.
    pub fn new(policy: &Policy) -> ArbiterState {
        let behaviors = &policy.behaviors;
        let mut order: Vec<usize> = (0..behaviors.len()).collect();
        order.sort_by_key(|&slot| (std::cmp::Reverse(behaviors[slot].priority), behaviors[slot].name));
        let row_of = |slot: usize| order.iter().position(|&s| s == slot);

        let mut watchdogs = Vec::new();
        let rules: Vec<BehaviorRule> = order
            .iter()
            .enumerate()
            .map(|(row, &slot)| {
                let behavior = &behaviors[slot];
                let lower = order[row..].iter().position(|&s| behaviors[s].priority < behavior.priority);
                let first = order.iter().position(|&s| behaviors[s].priority == behavior.priority);
                let (group_start, group_end) = match policy.ties {
                    TieRule::Strict => (row, row + 1),
                    TieRule::Blend => (first.unwrap_or(row), lower.map_or(order.len(), |n| row + n)),
                };
                let watchdog = behavior.critical.then(|| {
                    watchdogs.push((slot as u16, Watchdog::new(behavior.deadline)));
                    (watchdogs.len() - 1) as u16
                });
                BehaviorRule {
                    slot: slot as u16,
                    group_start: group_start as u16,
                    group_end: group_end as u16,
                    enabled: behavior.enabled,
                    sleeps: behavior.sleeps,
                    watchdog,
                    max_age_ns: nanoseconds(behavior.max_age),
                    max_evidence_age_ns: nanoseconds(behavior.max_evidence_age),
                    hold_ns: nanoseconds(behavior.hold),
                    dwell_ns: nanoseconds(behavior.dwell),
                }
            })
            .collect();
        let wires = policy
            .wires
            .iter()
            .filter_map(|wire| Some(ActiveWire::new(wire, row_of(wire.by)?, row_of(wire.what)?)))
            .collect();
        let n = rules.len();
        let dwelling = (0..n).filter(|&row| rules[row].dwell_ns > 0).map(|row| row as u16).collect();
        ArbiterState {
            dwelling,
            rules,
            candidates: vec![Candidate::default(); n],
            restraints: vec![Restraint::default(); n],
            dwell_timers: vec![DwellTimer::default(); n],
            wires: in_order(wires),
            drivers: Vec::with_capacity(n),
            restraining: Vec::with_capacity(n),
            watchdogs,
            sensors: policy.sensors.iter().map(|sensor| Watchdog::new(sensor.max_age)).collect(),
            bounds: PlausibleSpeeds::new(policy),
            drive_axes: policy.axes(),
            tolerance_ns: nanoseconds(policy.future_tolerance),
            has_budgets: behaviors.iter().any(|behavior| behavior.latency_budget.is_some()),
            stop_requests: StopRequests::default(),
            clock: DecisionClock::default(),
            ramp: Ramp::default(),
            sequence: 0,
        }
    }

    /// Latches the emergency stop.
    pub fn emergency_stop(&mut self) {
        self.stop_requests.emergency_stop();
    }

    /// Releases the emergency stop.
    pub fn reset(&mut self) {
        self.stop_requests.reset();
    }

    /// Brings the robot to a standstill for the end of the run.
    pub fn shut_down(&mut self) {
        self.stop_requests.shut_down();
    }

    /// Enables the behavior at `index` of the policy.
    pub fn enable(&mut self, index: usize) {
        self.rules
            .iter_mut()
            .filter(|rule| usize::from(rule.slot) == index)
            .for_each(|rule| rule.enabled = true);
    }

    /// Disables the behavior at `index` of the policy. A halt or limit of it is held as if it had died; a critical behavior
    /// counts as silent.
    pub fn disable(&mut self, index: usize) {
        self.rules
            .iter_mut()
            .filter(|rule| usize::from(rule.slot) == index)
            .for_each(|rule| rule.enabled = false);
    }

    /// Records that the critical sensor at `index` of the policy measured at `stamp`.
    pub fn sensor_measured(&mut self, index: usize, stamp: Time) {
        if let Some(watchdog) = self.sensors.get_mut(index) {
            watchdog.feed(stamp);
        }
    }

    /// Twist commanded last.
    pub fn commanded(&self) -> Twist {
        self.ramp.velocity()
    }

    pub(super) fn next_sequence(&mut self) -> u64 {
        self.sequence = self.sequence.wrapping_add(1);
        self.sequence
    }

    /// First critical behavior that is silent, or else the first critical sensor.
    pub(super) fn silent_part(&self, now: Time) -> Option<Stop> {
        let behavior = self
            .watchdogs
            .iter()
            .find(|(_, watchdog)| watchdog.is_silent(now, Duration::MAX))
            .map(|&(slot, _)| slot);
        let sensor = || {
            self.sensors
                .iter()
                .position(|watchdog| watchdog.is_silent(now, Duration::from_nanos(self.tolerance_ns)))
        };
        behavior.map(Stop::Behavior).or_else(|| sensor().map(|index| Stop::Sensor(index as u16)))
    }
}
