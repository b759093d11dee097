//! Step 1: checks each proposal and decides what it counts as.

use yamabico_core::message::{Axes, Kind, Outcome, Proposal, Twist};
use yamabico_core::time::Time;

use super::decision::{Decision, Remaining, Ruling};
use super::state::{ArbiterState, BehaviorRule, PlausibleSpeeds};

/// One behavior's standing in the current decision.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Candidate {
    /// Sequence and stamp of the newest proposal received.
    last: Option<(u64, u64)>,
    /// Set if it has a live proposal other than an abstention, or a halt or limit in force.
    pub active: bool,
    /// Set if it has a live drive proposal that is not inhibited.
    pub drives: bool,
    /// Set if it may have a halt or limit in force.
    restrains: bool,
    /// Axes that it claims, limits or halts, without those that the drive lacks.
    pub axes: Axes,
    /// Axes on which it is suppressed.
    pub suppressed: Axes,
    /// Row of the behavior that suppresses it.
    pub suppressor: u16,
}

/// Checks every proposal: lists the rows that drive and those with a halt or limit in force, and writes a first ruling on
/// each.
pub(super) fn screen(
    state: &mut ArbiterState,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) {
    state.drivers.clear();
    state.restraining.clear();
    for row in 0..state.rules.len() {
        let rule = &state.rules[row];
        let candidate = &mut state.candidates[row];
        let slot = usize::from(rule.slot);
        let proposal = if rule.enabled { proposals.get(slot).and_then(Option::as_ref) } else { None };
        candidate.begin();
        decision.rulings[slot] = match proposal {
            // The common case first: a valid drive of a behavior that has no watchdog and no halt or limit in force.
            Some(proposal)
                if proposal.kind == Kind::Drive.code()
                    && !(candidate.restrains || rule.watchdog.is_some())
                    && is_sound_drive(proposal, &state.bounds)
                    && fault_of_age(proposal, rule, now, state.tolerance_ns).is_none() =>
            {
                candidate.last = Some((proposal.sequence, proposal.stamp_ns));
                candidate.drive(proposal.axes.intersection(state.drive_axes));
                state.drivers.push(row as u16);
                Ruling {
                    kind: proposal.kind,
                    reason: proposal.reason,
                    claimed: proposal.axes,
                    ..Ruling::SILENT
                }
            }
            None if rule.enabled => Ruling::SILENT,
            // Its halt or limit may still be held; the ruling then records both.
            None => Ruling { outcome: Outcome::Disabled, fault: Some(Outcome::Disabled), ..Ruling::SILENT },
            Some(proposal) => {
                let kind = Kind::from_code(proposal.kind);
                let fault = fault(proposal, kind, rule, &state.bounds, now, state.tolerance_ns);
                let is_new = candidate.remember(proposal);
                if let (Some(watchdog), true, None) = (rule.watchdog, is_new, fault) {
                    state.watchdogs[usize::from(watchdog)].1.feed(now);
                }
                if kind == Some(Kind::Drive) && fault.is_none() {
                    candidate.drive(proposal.axes.intersection(state.drive_axes));
                    state.drivers.push(row as u16);
                }
                if candidate.restrains || matches!(kind, Some(Kind::Halt | Kind::Limit)) {
                    candidate.restrains = true;
                    state.restraints[row].update(proposal, kind, fault, is_new, rule, now);
                }
                first_ruling(proposal, kind, fault, now)
            }
        };
        if candidate.restrains {
            let restraint = &mut state.restraints[row];
            restraint.is_current &= proposal.is_some();
            candidate.restrains = restraint.expire(now);
            if candidate.restrains {
                state.restraining.push(row as u16);
                candidate.active = true;
                if !candidate.drives {
                    candidate.axes = restraint.axes().intersection(state.drive_axes);
                }
            }
        }
    }
}

impl Candidate {
    fn begin(&mut self) {
        (self.active, self.drives) = (false, false);
        (self.axes, self.suppressed) = (Axes::NONE, Axes::NONE);
    }

    fn drive(&mut self, claimed: Axes) {
        (self.active, self.drives, self.axes) = (true, true, claimed);
    }

    /// Stores sequence and stamp of `proposal`; returns true if it has not been received before.
    fn remember(&mut self, proposal: &Proposal) -> bool {
        let this = Some((proposal.sequence, proposal.stamp_ns));
        std::mem::replace(&mut self.last, this) != this
    }
}

/// Returns the ruling that stands unless wires, the allocation of axes, halts or limits change it.
fn first_ruling(proposal: &Proposal, kind: Option<Kind>, fault: Option<Outcome>, now: Time) -> Ruling {
    let outcome = fault.unwrap_or(match kind {
        Some(Kind::Halt) => Outcome::Halting,
        Some(Kind::Limit) => Outcome::Limiting,
        _ => Outcome::Abstained,
    });
    Ruling {
        outcome,
        fault,
        by: None,
        kind: proposal.kind,
        reason: proposal.reason,
        claimed: if proposal.axes.is_valid() { proposal.axes } else { Axes::NONE },
        won: Axes::NONE,
        number: match fault {
            None => 0.0,
            Some(fault) => age_s(proposal, fault, now),
        },
        remaining: Remaining::Now,
    }
}

/// Finds what is wrong with `proposal`.
fn fault(
    proposal: &Proposal,
    kind: Option<Kind>,
    rule: &BehaviorRule,
    bounds: &PlausibleSpeeds,
    now: Time,
    tolerance_ns: u64,
) -> Option<Outcome> {
    let well_formed = match kind {
        Some(Kind::Drive) => is_sound_drive(proposal, bounds),
        Some(Kind::Limit) => is_sound_limit(proposal),
        Some(Kind::Halt) => proposal.axes.is_valid(),
        Some(Kind::Abstain) => true,
        None => false,
    };
    if well_formed { fault_of_age(proposal, rule, now, tolerance_ns) } else { Some(Outcome::Malformed) }
}

/// Finds out if `proposal` or its evidence is too old or from the future.
fn fault_of_age(proposal: &Proposal, rule: &BehaviorRule, now: Time, tolerance_ns: u64) -> Option<Outcome> {
    if proposal.stamp_ns.max(proposal.evidence_ns).saturating_sub(now.0) > tolerance_ns {
        Some(Outcome::FromTheFuture)
    } else if now.0.saturating_sub(proposal.stamp_ns) > rule.max_age_ns {
        Some(Outcome::Stale)
    } else if now.0.saturating_sub(proposal.evidence_ns) > rule.max_evidence_age_ns {
        Some(Outcome::StaleEvidence)
    } else {
        None
    }
}

/// Age that makes the fault, s, negative for a stamp in the future; zero for other faults.
#[cold]
fn age_s(proposal: &Proposal, fault: Outcome, now: Time) -> f64 {
    match fault {
        Outcome::Stale => now.seconds_after(Time(proposal.stamp_ns)),
        Outcome::StaleEvidence => now.seconds_after(Time(proposal.evidence_ns)),
        Outcome::FromTheFuture => now.seconds_after(Time(proposal.stamp_ns.max(proposal.evidence_ns))),
        _ => 0.0,
    }
}

/// Returns true if the twist is finite and within twice the robot's limits on the claimed axes.
fn is_sound_drive(proposal: &Proposal, bounds: &PlausibleSpeeds) -> bool {
    let (twist, bound) = (&proposal.twist, bounds.of(proposal.axes));
    // No short-circuit evaluation: the conditions nearly always hold.
    proposal.axes.is_valid()
        & !proposal.axes.is_empty()
        & (twist.linear.abs() <= bound.linear)
        & (twist.lateral.abs() <= bound.lateral)
        & (twist.angular.abs() <= bound.angular)
        & (proposal.confidence >= 0.0)
        & (proposal.confidence <= 1.0)
}

fn is_sound_limit(proposal: &Proposal) -> bool {
    let Twist { linear, lateral, angular } = proposal.limits;
    proposal.axes.is_valid()
        && !proposal.axes.is_empty()
        && proposal.limits.is_finite()
        && linear.min(lateral).min(angular) >= 0.0
        && proposal.sector.center_rad.is_finite()
        && proposal.sector.half_width_rad.is_finite()
        && proposal.sector.half_width_rad >= 0.0
}
