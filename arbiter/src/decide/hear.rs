//! Step 1: which proposals count, and as what.

use yamabico_core::message::{Axes, Kind, Outcome, Proposal, Twist};
use yamabico_core::time::Time;

use super::decision::{Decision, Ruling};
use super::restrain::Assertion;
use super::state::{Bounds, Rule, State};

/// What one behaviour says in this decision, and what it said last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hearing {
    /// Sequence and stamp of the newest proposal seen.
    last: (u64, u64),
    /// Whether it has a live proposal other than to abstain, or a halt or limit still in force.
    pub active: bool,
    /// Whether it has a live drive proposal that nobody inhibits.
    pub drives: bool,
    /// Axes that it claims, limits or halts, as far as the drive has them.
    pub named: Axes,
    /// Axes on which it is suppressed.
    pub suppressed: Axes,
    /// Row of who suppresses it.
    pub suppressor: u16,
}

/// Hears every behaviour: lists who drives and whose halts and limits are in force, and writes a first ruling on each.
pub(super) fn hear(state: &mut State, proposals: &[Option<Proposal>], now: Time, decision: &mut Decision) {
    state.drivers.clear();
    state.restraining.clear();
    for row in 0..state.rules.len() {
        let rule = state.rules[row];
        let slot = usize::from(rule.slot);
        let proposal = if rule.enabled { proposals.get(slot).and_then(Option::as_ref) } else { None };
        let restraint = &mut state.restraints[row];
        let hearing = &mut state.hearings[row];
        (hearing.active, hearing.drives) = (false, false);
        (hearing.named, hearing.suppressed) = (Axes::NONE, Axes::NONE);
        restraint.is_current = false;

        let Some(proposal) = proposal else {
            let outcome = if rule.enabled { Outcome::Silent } else { Outcome::Disabled };
            decision.rulings[slot] = Ruling { outcome, ..Ruling::SILENT };
            if restraint.expire(now) {
                state.restraining.push(row as u16);
                (hearing.active, hearing.named) = (true, restraint.axes().intersection(state.has));
            }
            continue;
        };
        let kind = Kind::from_code(proposal.kind);
        let (fault, age_s) = match fault(proposal, kind, &rule, &state.bounds, now, state.tolerance_ns) {
            Some((fault, age_s)) => (Some(fault), age_s),
            None => (None, 0.0),
        };
        let is_new = hearing.last != (proposal.sequence, proposal.stamp_ns);
        hearing.last = (proposal.sequence, proposal.stamp_ns);

        let outcome = match kind {
            Some(Kind::Halt | Kind::Limit) => {
                let assertion = assertion(proposal, fault);
                if is_new {
                    restraint.assert(&assertion, proposal, &rule, now);
                }
                restraint.is_current = is_new || fault.is_none();
                fault.unwrap_or(if kind == Some(Kind::Halt) { Outcome::Halting } else { Outcome::Limiting })
            }
            _ => {
                if fault.is_none() && restraint.any() {
                    restraint.release(&rule);
                }
                if kind == Some(Kind::Drive) && fault.is_none() {
                    hearing.named = proposal.axes.intersection(state.has);
                    (hearing.active, hearing.drives) = (true, true);
                    state.drivers.push(row as u16);
                }
                fault.unwrap_or(Outcome::Abstained)
            }
        };
        if restraint.expire(now) {
            state.restraining.push(row as u16);
            hearing.active = true;
            if !hearing.drives {
                hearing.named = restraint.axes().intersection(state.has);
            }
        }
        decision.rulings[slot] = Ruling {
            outcome,
            fault,
            by: None,
            kind: proposal.kind,
            reason: proposal.reason,
            claimed: if proposal.axes.is_valid() { proposal.axes } else { Axes::NONE },
            won: Axes::NONE,
            number: age_s,
        };
        if let (Some(watch), true, None) = (rule.watch, is_new, fault) {
            state.behaviour_heard(watch, now);
        }
    }
}

/// What is wrong with `proposal`, and the age that is too great in seconds or zero.
fn fault(
    proposal: &Proposal,
    kind: Option<Kind>,
    rule: &Rule,
    bounds: &Bounds,
    now: Time,
    tolerance_ns: u64,
) -> Option<(Outcome, f64)> {
    let well_formed = match kind {
        Some(Kind::Drive) => is_sound_drive(proposal, bounds),
        Some(Kind::Limit) => is_sound_limit(proposal),
        Some(Kind::Halt) => proposal.axes.is_valid(),
        Some(Kind::Abstain) => true,
        None => false,
    };
    if !well_formed {
        return Some((Outcome::Malformed, 0.0));
    }
    let age_ns = now.0.saturating_sub(proposal.stamp_ns);
    let evidence_age_ns = now.0.saturating_sub(proposal.evidence_ns);
    if proposal.stamp_ns.max(proposal.evidence_ns).saturating_sub(now.0) > tolerance_ns {
        let newest = Time(proposal.stamp_ns.max(proposal.evidence_ns));
        Some((Outcome::FromTheFuture, now.seconds_after(newest)))
    } else if age_ns > rule.max_age_ns {
        Some((Outcome::Stale, age_ns as f64 * 1e-9))
    } else if evidence_age_ns > rule.max_evidence_age_ns {
        Some((Outcome::StaleEvidence, evidence_age_ns as f64 * 1e-9))
    } else {
        None
    }
}

/// Finite, and within twice the robot's limits on the axes that it claims.
fn is_sound_drive(proposal: &Proposal, bounds: &Bounds) -> bool {
    let (twist, bound) = (&proposal.twist, bounds.of(proposal.axes));
    proposal.axes.is_valid()
        && !proposal.axes.is_empty()
        && twist.linear.abs() <= bound.linear
        && twist.lateral.abs() <= bound.lateral
        && twist.angular.abs() <= bound.angular
        && (0.0..=1.0).contains(&proposal.confidence)
}

fn is_sound_limit(proposal: &Proposal) -> bool {
    let Twist { linear, lateral, angular } = proposal.limits;
    proposal.axes.is_valid()
        && !proposal.axes.is_empty()
        && proposal.limits.is_finite()
        && linear.min(lateral).min(angular) >= 0.0
        && proposal.sector.centre_rad.is_finite()
        && proposal.sector.half_width_rad.is_finite()
        && proposal.sector.half_width_rad >= 0.0
}

/// What a halt or limit asserts: as it says while it is sound; one that is malformed concerns every axis that it does not
/// clearly leave out.
fn assertion(proposal: &Proposal, fault: Option<Outcome>) -> Assertion {
    let axes = if proposal.axes.is_valid() && !proposal.axes.is_empty() { proposal.axes } else { Axes::ALL };
    match (Kind::from_code(proposal.kind), fault) {
        (Some(Kind::Halt), fault) => Assertion::Halt { axes, sound: fault.is_none() },
        (_, None) => Assertion::Limit { axes, limits: proposal.limits, sector: proposal.sector },
        (_, Some(_)) => Assertion::Blind { axes },
    }
}
