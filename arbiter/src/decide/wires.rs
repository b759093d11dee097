//! Step 2: inhibition and suppression of drive proposals.

use yamabico_core::message::{Axes, Outcome};
use yamabico_core::time::Time;

use super::decision::{Decision, Remaining};
use super::state::{ArbiterState, nanoseconds};
use crate::policy::{Wire, WireKind};

/// Wire between two behaviors, given by their rows in the decision, with its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActiveWire {
    kind: WireKind,
    by: usize,
    what: usize,
    hold_ns: u64,
    /// End of the hold time, until which the wire acts although `by` is no longer active.
    until: Time,
    /// Axes that `by` claims or last claimed.
    axes: Axes,
}

impl ActiveWire {
    pub fn new(wire: &Wire, by: usize, what: usize) -> ActiveWire {
        ActiveWire {
            kind: wire.kind,
            by,
            what,
            hold_ns: nanoseconds(wire.hold),
            until: Time::ZERO,
            axes: Axes::NONE,
        }
    }
}

/// Removes inhibited drive proposals and suppressed axes from the decision. An inhibited behavior is not active, so its own
/// wires do not act.
pub(super) fn apply(state: &mut ArbiterState, now: Time, decision: &mut Decision) {
    for wire in &mut state.wires {
        let by = state.candidates[wire.by];
        if by.active {
            wire.until = Time(now.0.saturating_add(wire.hold_ns));
            wire.axes = by.axes;
        }
        let (what, rule) = (&mut state.candidates[wire.what], &state.rules[wire.what]);
        let ruling = &mut decision.rulings[usize::from(rule.slot)];
        if !(what.drives || rule.sleeps && is_asleep(ruling.outcome)) || !(by.active || now < wire.until) {
            continue;
        }
        let remaining = if by.active { Remaining::Now } else { Remaining::until(wire.until, now) };
        match wire.kind {
            WireKind::Inhibit => {
                (what.drives, what.active) = (false, state.restraints[wire.what].any());
                ruling.outcome = Outcome::Inhibited;
                ruling.by = Some(state.rules[wire.by].slot);
                ruling.remaining = remaining;
            }
            WireKind::Suppress => {
                if what.suppressed.is_empty() {
                    what.suppressor = wire.by as u16;
                }
                what.suppressed = what.suppressed.union(wire.axes);
                ruling.remaining = remaining;
            }
        }
    }
}

/// Returns true for the outcomes of a behavior that has stopped proposing because it is inhibited.
fn is_asleep(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Silent | Outcome::Stale | Outcome::StaleEvidence)
}

/// Sorts wires so that those into a row come before those out of it; wires of a cycle come last.
pub(super) fn in_order(mut wires: Vec<ActiveWire>) -> Vec<ActiveWire> {
    let rows = wires.iter().map(|wire| wire.by.max(wire.what) + 1).max().unwrap_or(0);
    let mut order = vec![usize::MAX; rows];
    for next in 0..rows {
        let free = (0..rows).find(|&row| {
            order[row] == usize::MAX
                && wires.iter().all(|wire| wire.what != row || order[wire.by] != usize::MAX)
        });
        match free {
            Some(row) => order[row] = next,
            None => break,
        }
    }
    wires.sort_by_key(|wire| (order[wire.what], wire.what, wire.by, wire.kind == WireKind::Suppress));
    wires
}
