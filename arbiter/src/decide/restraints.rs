//! Steps 3 and 4: halts and limits, how long they stay in force, and the motion that they allow.

use yamabico_core::geometry::angle_difference;
use yamabico_core::message::{Axes, Kind, Outcome, Proposal, Sector, Twist};
use yamabico_core::time::Time;

use super::decision::{Decision, Remaining, Ruling};
use super::state::{ArbiterState, BehaviorRule};
use crate::safety::Stop;

/// A halt or limit as proposed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Assertion {
    /// A halt. One that is stale or malformed (not `sound`) counts too, but releases nothing.
    Halt { axes: Axes, sound: bool },
    /// A valid limit.
    Limit { axes: Axes, limits: Twist, sector: Sector },
    /// A stale or malformed limit: zero in every direction.
    Blind { axes: Axes },
}

/// Halt and limit of one behavior that are in force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Restraint {
    /// Axes that it halts.
    halted: Axes,
    /// Time of the last request to halt each axis.
    halt_requested: [Time; 3],
    /// Last instant at which each axis is halted without a new proposal of the author.
    halt_until: [Time; 3],
    /// Axes that it limits.
    limited: Axes,
    limits: Twist,
    sector: Sector,
    /// Later than this the author counts as silent, and the limit is zero in every direction.
    limit_sound_until: Time,
    limit_until: Time,
    /// Set if the newest proposal itself halts or limits; otherwise the halt or limit is held.
    pub is_current: bool,
}

impl Default for Restraint {
    fn default() -> Self {
        Restraint {
            halted: Axes::NONE,
            halt_requested: [Time::ZERO; 3],
            halt_until: [Time::ZERO; 3],
            limited: Axes::NONE,
            limits: Twist::ZERO,
            sector: Sector::ALL,
            limit_sound_until: Time::ZERO,
            limit_until: Time::ZERO,
            is_current: false,
        }
    }
}

impl Restraint {
    /// Axes that it halts or limits.
    pub fn axes(&self) -> Axes {
        self.halted.union(self.limited)
    }

    /// Returns true if a halt or limit is in force.
    pub fn any(&self) -> bool {
        !self.axes().is_empty()
    }

    /// Takes in the author's newest proposal, of any kind. A valid one replaces the earlier halt or limit as soon as `hold`
    /// permits.
    pub fn update(
        &mut self,
        proposal: &Proposal,
        kind: Option<Kind>,
        fault: Option<Outcome>,
        is_new: bool,
        rule: &BehaviorRule,
        now: Time,
    ) {
        let assertion = match kind {
            Some(Kind::Halt | Kind::Limit) => assertion(proposal, kind, fault),
            _ => {
                self.is_current = false;
                if fault.is_none() {
                    self.release(rule);
                }
                return;
            }
        };
        self.is_current = is_new || fault.is_none();
        if is_new || (fault.is_none() && !self.any()) {
            self.assert(assertion, proposal, rule, now);
        }
    }

    fn assert(&mut self, assertion: Assertion, proposal: &Proposal, rule: &BehaviorRule, now: Time) {
        let sound_until = Time(
            (proposal.stamp_ns.min(now.0).saturating_add(rule.max_age_ns))
                .min(proposal.evidence_ns.min(now.0).saturating_add(rule.max_evidence_age_ns)),
        );
        // The silence of a critical author releases nothing.
        let until = |from: Time| {
            if rule.watchdog.is_some() { Time::MAX } else { Time(from.0.saturating_add(rule.hold_ns)) }
        };
        match assertion {
            Assertion::Halt { axes, sound } => {
                if sound {
                    self.release(rule);
                }
                let until = until(if sound { sound_until } else { now });
                for axis in axes.iter().map(|axis| axis as usize) {
                    self.halt_requested[axis] = now;
                    self.halt_until[axis] = self.halt_until[axis].max(until);
                }
                self.halted = self.halted.union(axes);
            }
            Assertion::Limit { axes, limits, sector } => {
                self.release(rule);
                (self.limited, self.limits, self.sector) = (axes, limits, sector);
                (self.limit_sound_until, self.limit_until) = (sound_until, until(sound_until));
            }
            Assertion::Blind { axes } => {
                self.limited = self.limited.union(axes);
                self.limit_sound_until = Time::ZERO;
                self.limit_until = self.limit_until.max(until(now));
            }
        }
    }

    /// Ends the limit at once, and the halt as soon as it has lasted for `hold`: the author proposes something else.
    fn release(&mut self, rule: &BehaviorRule) {
        for axis in self.halted.iter().map(|axis| axis as usize) {
            let earliest = Time(self.halt_requested[axis].0.saturating_add(rule.hold_ns));
            self.halt_until[axis] = self.halt_until[axis].min(earliest);
        }
        self.limited = Axes::NONE;
        self.limit_until = Time::ZERO;
    }

    /// Drops what has expired at `now`; returns true if a halt or limit is still in force.
    pub fn expire(&mut self, now: Time) -> bool {
        for axis in self.halted.iter() {
            if now > self.halt_until[axis as usize] {
                self.halted = self.halted.without(axis.into());
                self.halt_until[axis as usize] = Time::ZERO;
            }
        }
        if now > self.limit_until {
            self.limited = Axes::NONE;
        }
        self.any()
    }

    /// Last instant at which a halt or limit is in force without a new proposal of the author.
    fn until(&self) -> Time {
        let halts = self.halted.iter().map(|axis| self.halt_until[axis as usize]);
        let limit = (!self.limited.is_empty()).then_some(self.limit_until);
        halts.chain(limit).max().unwrap_or(Time::ZERO)
    }

    /// Limit at `now` and the sector in which it counts.
    fn limit(&self, now: Time) -> (Twist, Sector) {
        if now <= self.limit_sound_until { (self.limits, self.sector) } else { (Twist::ZERO, Sector::ALL) }
    }
}

/// Reads a halt or limit from a proposal. A malformed one concerns every axis unless its axes are valid.
fn assertion(proposal: &Proposal, kind: Option<Kind>, fault: Option<Outcome>) -> Assertion {
    let axes = if proposal.axes.is_valid() && !proposal.axes.is_empty() { proposal.axes } else { Axes::ALL };
    match (kind, fault) {
        (Some(Kind::Halt), fault) => Assertion::Halt { axes, sound: fault.is_none() },
        (_, None) => Assertion::Limit { axes, limits: proposal.limits, sector: proposal.sector },
        (_, Some(_)) => Assertion::Blind { axes },
    }
}

/// Records which axes are halted, and by which behavior.
pub(super) fn find_halts(state: &ArbiterState, decision: &mut Decision) {
    for (slot, restraint) in in_force(state) {
        for axis in restraint.halted.intersection(state.drive_axes).iter() {
            decision.halted = decision.halted.union(axis.into());
            decision.halted_by[axis as usize].get_or_insert(slot);
        }
    }
}

/// Applies halts and limits to `motion`; records the binding limits, and rules on every halt and limit.
pub(super) fn apply(state: &ArbiterState, now: Time, motion: Twist, decision: &mut Decision) -> Twist {
    let mut motion = motion;
    for axis in decision.halted.iter() {
        motion.set(axis, 0.0);
    }

    let directions = SweptDirections::new(state.ramp.velocity(), motion);
    let mut limited = Axes::NONE;
    let mut smallest = Twist::ZERO;
    for (slot, restraint) in in_force(state) {
        let (limits, sector) = restraint.limit(now);
        let counts = !restraint.limited.is_empty() && directions.enter(&sector);
        rule_on(restraint, counts, limits, now, &mut decision.rulings[usize::from(slot)]);
        if !counts {
            continue;
        }
        for axis in restraint.limited.intersection(state.drive_axes).iter() {
            if !limited.contains(axis) || limits.get(axis) < smallest.get(axis) {
                limited = limited.union(axis.into());
                smallest.set(axis, limits.get(axis));
                decision.limited_by[axis as usize] = Some((slot, limits.get(axis)));
            }
        }
    }
    limited_to(motion, limited, smallest)
}

/// Slots and restraints in force, the highest priority first.
fn in_force(state: &ArbiterState) -> impl Iterator<Item = (u16, &Restraint)> {
    state
        .restraining
        .iter()
        .map(|&row| (state.rules[usize::from(row)].slot, &state.restraints[usize::from(row)]))
}

fn rule_on(restraint: &Restraint, counts: bool, limits: Twist, now: Time, ruling: &mut Ruling) {
    let halts = !restraint.halted.is_empty();
    ruling.outcome = match (restraint.is_current, halts, counts) {
        (false, _, _) => Outcome::Held,
        (true, true, _) => Outcome::Halting,
        (true, false, true) => Outcome::Limiting,
        (true, false, false) => Outcome::LimitElsewhere,
    };
    if !restraint.is_current {
        ruling.kind = if halts { Kind::Halt } else { Kind::Limit }.code();
        ruling.remaining = Remaining::until(restraint.until(), now);
    }
    if ruling.won.is_empty() {
        ruling.claimed = if halts { restraint.halted } else { restraint.limited };
    }
    if !halts {
        ruling.number =
            restraint.limited.iter().fold(f64::INFINITY, |smallest, axis| limits.get(axis).min(smallest));
    }
}

/// Limits the speed of `motion` on each axis of `axes` to that of `limits`. The translation keeps its direction: if one of
/// its axes must slow down, the other slows down in proportion. So a limit never turns the robot into a sector that it was
/// not heading for, and one more limit never raises a speed.
pub(super) fn limited_to(motion: Twist, axes: Axes, limits: Twist) -> Twist {
    let mut factor = 1.0_f64;
    for axis in axes.without(Axes::ANGULAR).iter() {
        let (speed, limit) = (motion.get(axis).abs(), limits.get(axis).max(0.0));
        if speed > limit {
            factor = factor.min(limit / speed);
        }
    }
    let mut slowed = motion;
    if factor < 1.0 {
        (slowed.linear, slowed.lateral) = (motion.linear * factor, motion.lateral * factor);
    }
    // Rounding may put the product above the limit.
    for axis in axes.iter() {
        let limit = limits.get(axis).max(0.0);
        slowed.set(axis, slowed.get(axis).max(-limit).min(limit));
    }
    slowed
}

/// Directions of translation that the robot passes through between two velocities.
///
/// A ramp is a straight line between the velocities and so sweeps the smaller angle between their directions; if they are
/// opposite, it passes through zero.
struct SweptDirections {
    from_rad: Option<f64>,
    to_rad: Option<f64>,
}

/// Directions closer than this are equal, rad.
const SAME_RAD: f64 = 1e-9;
/// A translation slower than this has no direction, m/s.
const STANDING_MPS: f64 = 1e-9;

impl SweptDirections {
    fn new(from: Twist, to: Twist) -> SweptDirections {
        SweptDirections { from_rad: direction(from), to_rad: direction(to) }
    }

    /// Returns true if one of the directions lies in `sector`. A robot that stands and is to stand enters no sector except
    /// the full circle.
    fn enter(&self, sector: &Sector) -> bool {
        if sector.half_width_rad >= std::f64::consts::PI {
            return true;
        }
        let offset = |direction_rad: f64| angle_difference(direction_rad, sector.center_rad);
        let is_inside = |direction_rad: f64| offset(direction_rad).abs() <= sector.half_width_rad + SAME_RAD;
        match (self.from_rad, self.to_rad) {
            (Some(from), Some(to)) => {
                let turn = angle_difference(to, from);
                let straddles = turn.abs() < std::f64::consts::PI - SAME_RAD
                    && offset(from) * offset(to) < 0.0
                    && (offset(from) - offset(to)).abs() < std::f64::consts::PI;
                is_inside(from) || is_inside(to) || straddles
            }
            (Some(only), None) | (None, Some(only)) => is_inside(only),
            (None, None) => false,
        }
    }
}

/// Direction of translation in the robot frame, rad; `None` at a standstill.
fn direction(twist: Twist) -> Option<f64> {
    (twist.speed() > STANDING_MPS).then(|| twist.lateral.atan2(twist.linear))
}

/// Takes from the winners the axes that a halt or a stop of the whole robot stops.
pub(super) fn revoke_stopped_axes(state: &ArbiterState, decision: &mut Decision) {
    if decision.stop.is_some() {
        decision.allowed = Twist::ZERO;
    }
    let stopped = if decision.stop.is_some() { Axes::ALL } else { decision.halted };
    if stopped.is_empty() {
        return;
    }
    for &row in &state.drivers {
        let ruling = &mut decision.rulings[usize::from(state.rules[usize::from(row)].slot)];
        let Some(axis) = ruling.won.intersection(stopped).iter().next() else { continue };
        ruling.won = ruling.won.without(stopped);
        if ruling.won.is_empty() && ruling.outcome != Outcome::Held {
            ruling.outcome = Outcome::Stopped;
            ruling.by = match decision.stop {
                Some(Stop::Behavior(index)) => Some(index),
                Some(_) => None,
                None => decision.halted_by[axis as usize],
            };
        }
    }
}
