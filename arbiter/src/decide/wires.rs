//! Step 2: who keeps whom from driving.

use yamabico_core::message::{Axes, Outcome};
use yamabico_core::time::Time;

use super::decision::{Decision, Lasting};
use super::state::{State, nanoseconds};
use crate::policy::{Wire, WireKind};

/// A wire between rows, and how long it still holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    kind: WireKind,
    by: usize,
    what: usize,
    hold_ns: u64,
    /// It holds before this instant, though `by` is not active.
    until: Time,
    /// What `by` claims or last claimed.
    axes: Axes,
}

impl Line {
    pub fn new(wire: &Wire, by: usize, what: usize) -> Line {
        Line {
            kind: wire.kind,
            by,
            what,
            hold_ns: nanoseconds(wire.hold),
            until: Time::ZERO,
            axes: Axes::NONE,
        }
    }
}

/// Takes drive proposals, or axes of them, out of the contest. An inhibited behavior is not active, and so its own wires
/// rest.
pub(super) fn apply(state: &mut State, now: Time, decision: &mut Decision) {
    for line in &mut state.lines {
        let by = state.hearings[line.by];
        if by.active {
            line.until = Time(now.0.saturating_add(line.hold_ns));
            line.axes = by.named;
        }
        let (what, rule) = (&mut state.hearings[line.what], &state.rules[line.what]);
        let ruling = &mut decision.rulings[usize::from(rule.slot)];
        if !(what.drives || rule.sleeps && is_asleep(ruling.outcome)) || !(by.active || now < line.until) {
            continue;
        }
        let lasts = if by.active { Lasting::Now } else { Lasting::until(line.until, now) };
        match line.kind {
            WireKind::Inhibit => {
                (what.drives, what.active) = (false, state.restraints[line.what].any());
                ruling.outcome = Outcome::Inhibited;
                ruling.by = Some(state.rules[line.by].slot);
                ruling.lasts = lasts;
            }
            WireKind::Suppress => {
                if what.suppressed.is_empty() {
                    what.suppressor = line.by as u16;
                }
                what.suppressed = what.suppressed.union(line.axes);
                decision.rulings[usize::from(state.rules[line.what].slot)].lasts = lasts;
            }
        }
    }
}

/// Whether it is what a behavior leaves that is not asked, or that has not been told to wake up yet.
fn is_asleep(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Silent | Outcome::Stale | Outcome::StaleEvidence)
}

/// Every line into a row before the lines out of it; those of a cycle last.
pub(super) fn in_order(mut lines: Vec<Line>) -> Vec<Line> {
    let rows = lines.iter().map(|line| line.by.max(line.what) + 1).max().unwrap_or(0);
    let mut place = vec![usize::MAX; rows];
    for next in 0..rows {
        let free = (0..rows).find(|&row| {
            place[row] == usize::MAX
                && lines.iter().all(|line| line.what != row || place[line.by] != usize::MAX)
        });
        match free {
            Some(row) => place[row] = next,
            None => break,
        }
    }
    lines.sort_by_key(|line| (place[line.what], line.what, line.by, line.kind == WireKind::Suppress));
    lines
}
