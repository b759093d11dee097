//! Step 1: which proposals count, and as what.

use yamabico_core::message::{Axes, Kind, Outcome, Proposal, Twist};
use yamabico_core::time::Time;

use super::decision::{Decision, Lasting, Ruling};
use super::state::{Bounds, Rule, State};

/// What one behavior says in this decision, and what it said last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hearing {
    /// Sequence and stamp of the newest proposal seen.
    last: Option<(u64, u64)>,
    /// Whether it has a live proposal other than to abstain, or a halt or limit still in force.
    pub active: bool,
    /// Whether it has a live drive proposal that nobody inhibits.
    pub drives: bool,
    /// Whether it may have a halt or limit in force.
    restrains: bool,
    /// Axes that it claims, limits or halts, as far as the drive has them.
    pub named: Axes,
    /// Axes on which it is suppressed.
    pub suppressed: Axes,
    /// Row of who suppresses it.
    pub suppressor: u16,
}

/// Hears every behavior: lists who drives and whose halts and limits are in force, and writes a first ruling on each.
pub(super) fn hear(state: &mut State, proposals: &[Option<Proposal>], now: Time, decision: &mut Decision) {
    state.drivers.clear();
    state.restraining.clear();
    for row in 0..state.rules.len() {
        let rule = &state.rules[row];
        let hearing = &mut state.hearings[row];
        let slot = usize::from(rule.slot);
        let proposal = if rule.enabled { proposals.get(slot).and_then(Option::as_ref) } else { None };
        hearing.begin();
        decision.rulings[slot] = match proposal {
            // The common case first: a sound drive of somebody with nothing else to watch.
            Some(proposal)
                if proposal.kind == Kind::Drive.code()
                    && !(hearing.restrains || rule.watch.is_some())
                    && is_sound_drive(proposal, &state.bounds)
                    && fault_of_age(proposal, rule, now, state.tolerance_ns).is_none() =>
            {
                hearing.last = Some((proposal.sequence, proposal.stamp_ns));
                hearing.drive(proposal.axes.intersection(state.has));
                state.drivers.push(row as u16);
                Ruling {
                    kind: proposal.kind,
                    reason: proposal.reason,
                    claimed: proposal.axes,
                    ..Ruling::SILENT
                }
            }
            None if rule.enabled => Ruling::SILENT,
            // Its halt may outlast it, and is then what is ruled on.
            None => Ruling { outcome: Outcome::Disabled, fault: Some(Outcome::Disabled), ..Ruling::SILENT },
            Some(proposal) => {
                let kind = Kind::from_code(proposal.kind);
                let fault = fault(proposal, kind, rule, &state.bounds, now, state.tolerance_ns);
                let is_new = hearing.remember(proposal);
                if let (Some(watch), true, None) = (rule.watch, is_new, fault) {
                    state.watches[usize::from(watch)].1.hear(now);
                }
                if kind == Some(Kind::Drive) && fault.is_none() {
                    hearing.drive(proposal.axes.intersection(state.has));
                    state.drivers.push(row as u16);
                }
                if hearing.restrains || matches!(kind, Some(Kind::Halt | Kind::Limit)) {
                    hearing.restrains = true;
                    state.restraints[row].hear(proposal, kind, fault, is_new, rule, now);
                }
                first_ruling(proposal, kind, fault, now)
            }
        };
        if hearing.restrains {
            let restraint = &mut state.restraints[row];
            restraint.is_current &= proposal.is_some();
            hearing.restrains = restraint.expire(now);
            if hearing.restrains {
                state.restraining.push(row as u16);
                hearing.active = true;
                if !hearing.drives {
                    hearing.named = restraint.axes().intersection(state.has);
                }
            }
        }
    }
}

impl Hearing {
    fn begin(&mut self) {
        (self.active, self.drives) = (false, false);
        (self.named, self.suppressed) = (Axes::NONE, Axes::NONE);
    }

    fn drive(&mut self, claimed: Axes) {
        (self.active, self.drives, self.named) = (true, true, claimed);
    }

    /// Whether `proposal` has not been seen before.
    fn remember(&mut self, proposal: &Proposal) -> bool {
        let this = Some((proposal.sequence, proposal.stamp_ns));
        std::mem::replace(&mut self.last, this) != this
    }
}

/// A ruling that stands unless wires, the contest or what is in force change it.
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
        lasts: Lasting::Now,
    }
}

/// What is wrong with `proposal`.
fn fault(
    proposal: &Proposal,
    kind: Option<Kind>,
    rule: &Rule,
    bounds: &Bounds,
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

/// Whether `proposal` or its evidence is too old, or from the future.
fn fault_of_age(proposal: &Proposal, rule: &Rule, now: Time, tolerance_ns: u64) -> Option<Outcome> {
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

/// The age that makes the fault, seconds, negative in the future; zero for other faults.
#[cold]
fn age_s(proposal: &Proposal, fault: Outcome, now: Time) -> f64 {
    match fault {
        Outcome::Stale => now.seconds_after(Time(proposal.stamp_ns)),
        Outcome::StaleEvidence => now.seconds_after(Time(proposal.evidence_ns)),
        Outcome::FromTheFuture => now.seconds_after(Time(proposal.stamp_ns.max(proposal.evidence_ns))),
        _ => 0.0,
    }
}

/// Finite, and within twice the robot's limits on the axes that it claims.
fn is_sound_drive(proposal: &Proposal, bounds: &Bounds) -> bool {
    let (twist, bound) = (&proposal.twist, bounds.of(proposal.axes));
    // Without short cuts, since all of it holds nearly always.
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
