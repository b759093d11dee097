//! Step 5: gives each axis to a drive proposal.

use std::ops::Range;

use yamabico_core::message::{Axes, Axis, Outcome, Proposal};
use yamabico_core::time::Time;

use super::decision::{Decision, Remaining};
use super::screening::Candidate;
use super::state::ArbiterState;

/// Time until which lower priorities wait for each axis that a behavior drove.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DwellTimer {
    until: [Time; 3],
}

/// Axes given away so far, while the rows are visited in order.
#[derive(Default)]
struct Allocation {
    /// Axes given to a higher priority.
    taken: Axes,
    /// Slot of the behavior that drives every axis of the drive, if one does.
    holder: Option<u16>,
    /// Axes that a higher priority stopped driving less than its dwell time ago.
    reserved: Axes,
    /// Row that reserves each axis.
    reserver: [u16; 3],
}

/// Confidence-weighted mean of the proposals for one axis.
#[derive(Clone, Copy, Default)]
struct Share {
    count: u32,
    weights: f64,
    weighted: f64,
    sum: f64,
    /// Slot and confidence of the most confident proposal.
    leader: Option<(u16, f64)>,
}

impl Share {
    fn add(&mut self, slot: u16, speed: f64, confidence: f64) {
        self.count += 1;
        self.weights += confidence;
        self.weighted += confidence * speed;
        self.sum += speed;
        if self.leader.is_none_or(|(_, highest)| confidence > highest) {
            self.leader = Some((slot, confidence));
        }
    }

    /// Speed of a single proposal, or the weighted mean of several; the plain mean if every confidence is zero.
    fn speed(&self) -> f64 {
        if self.count > 1 && self.weights > 0.0 {
            self.weighted / self.weights
        } else {
            self.sum / f64::from(self.count)
        }
    }
}

/// Gives each axis to the highest priority that claims it; writes `decision.wanted` and `decision.source`.
pub(super) fn allocate(
    state: &mut ArbiterState,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) {
    let mut allocation = Allocation::default();
    let (mut next, mut next_dwelling) = (0, 0);
    while next < state.drivers.len() {
        let row = usize::from(state.drivers[next]);
        let rule = &state.rules[row];
        if allocation.rejects(&state.candidates[row]) {
            let ruling = &mut decision.rulings[usize::from(rule.slot)];
            (ruling.outcome, ruling.by) = (Outcome::Outranked, allocation.holder);
            next += 1;
            continue;
        }
        while next_dwelling < state.dwelling.len() && state.dwelling[next_dwelling] < rule.group_start {
            allocation.reserve(state.dwelling[next_dwelling], state, now);
            next_dwelling += 1;
        }
        let end = next + state.drivers[next..].iter().take_while(|&&row| row < rule.group_end).count();
        allocate_group(state, proposals, next..end, now, &mut allocation, decision);
        if allocation.taken == state.drive_axes {
            allocation.holder = one_of(&decision.source);
        }
        next = end;
    }
}

/// Divides the free axes among the drivers in `range`, which all have the same priority.
fn allocate_group(
    state: &mut ArbiterState,
    proposals: &[Option<Proposal>],
    range: Range<usize>,
    now: Time,
    allocation: &mut Allocation,
    decision: &mut Decision,
) {
    let mut shares = [Share::default(); 3];
    for i in range.clone() {
        let row = usize::from(state.drivers[i]);
        let slot = state.rules[row].slot;
        let Some(proposal) = proposals.get(usize::from(slot)).and_then(Option::as_ref) else { continue };
        if !state.candidates[row].drives {
            continue;
        }
        let (won, outcome, by) = allocation.bid(state, row, proposal, decision);
        if outcome == Outcome::GaveUp && by.is_some() && allocation.offers_all(&state.candidates[row]) {
            decision.held_back.get_or_insert(proposal.twist);
        }
        for axis in won.iter() {
            shares[axis as usize].add(slot, proposal.twist.get(axis), proposal.confidence);
        }
        if !won.is_empty() {
            let evidence = Time(proposal.evidence_ns);
            if decision.evidence_of.is_none() || evidence < decision.evidence {
                decision.evidence_of = Some(slot);
            }
            decision.evidence = decision.evidence.min(evidence);
            state.dwell_timers[row].extend(won, Time(now.0.saturating_add(state.rules[row].dwell_ns)));
        }
        let ruling = &mut decision.rulings[usize::from(slot)];
        (ruling.won, ruling.outcome, ruling.by) = (won, outcome, by);
        match outcome {
            Outcome::Suppressed | Outcome::GaveUp | Outcome::WonPart => {}
            Outcome::Waiting => ruling.remaining = allocation.waiting_time(state, row, now),
            _ => ruling.remaining = Remaining::Now,
        }
    }
    for axis in Axis::ALL {
        let share = &shares[axis as usize];
        if let Some((leader, _)) = share.leader {
            allocation.taken = allocation.taken.union(axis.into());
            decision.wanted.set(axis, share.speed());
            decision.source[axis as usize] = Some(leader);
        }
    }
    if shares.iter().any(|share| share.count > 1) {
        for &row in &state.drivers[range] {
            let ruling = &mut decision.rulings[usize::from(state.rules[usize::from(row)].slot)];
            if ruling.won.iter().any(|axis| shares[axis as usize].count > 1) {
                ruling.outcome = Outcome::Blended;
            }
        }
    }
}

/// Returns the only behavior among `slots`; `None` if there are none or several.
fn one_of(slots: &[Option<u16>; 3]) -> Option<u16> {
    let mut some = slots.iter().flatten();
    let first = some.next().copied();
    if some.all(|slot| Some(*slot) == first) { first } else { None }
}

impl Allocation {
    /// Returns true if the driver gets nothing because one other behavior has every axis: the common case, decided without
    /// a look at the proposal.
    fn rejects(&self, candidate: &Candidate) -> bool {
        self.holder.is_some()
            && candidate.drives
            && !candidate.axes.is_empty()
            && candidate.suppressed.is_empty()
    }

    /// Returns true if no other behavior keeps the driver from any axis that it claims. If it gives up nevertheless
    /// because of a behavior, that one halts.
    fn offers_all(&self, candidate: &Candidate) -> bool {
        candidate.axes.intersection(candidate.suppressed.union(self.taken).union(self.reserved)).is_empty()
    }

    /// Returns the axes that the driver in `row` gets, the outcome, and the behavior that kept the rest from it.
    fn bid(
        &self,
        state: &ArbiterState,
        row: usize,
        proposal: &Proposal,
        decision: &Decision,
    ) -> (Axes, Outcome, Option<u16>) {
        let candidate = &state.candidates[row];
        let free = candidate.axes.without(candidate.suppressed).without(self.taken).without(self.reserved);
        let lost = candidate.axes.without(free);
        let unsupported = proposal.axes.without(state.drive_axes);
        if lost.is_empty() && unsupported.is_empty() && decision.halted.is_empty() {
            return (free, Outcome::Won, None);
        }
        // The rest of a coupled motion after a halt would be an arc that no behavior proposed. If nothing is left, the
        // motion is stopped as a whole.
        let cut = decision.halted.intersection(free).iter().find(|&axis| proposal.twist.get(axis) != 0.0);
        if let (Some(axis), true) = (cut, proposal.coupled != 0 && !free.without(decision.halted).is_empty())
        {
            return (Axes::NONE, Outcome::GaveUp, decision.halted_by[axis as usize]);
        }
        // A motion along an axis that the drive lacks is lost as well.
        let impossible = unsupported.iter().any(|axis| proposal.twist.get(axis) != 0.0);
        let Some(first) = lost.iter().next() else {
            return match (impossible, proposal.coupled != 0) {
                _ if free.is_empty() => (free, Outcome::Outranked, None),
                (true, true) => (Axes::NONE, Outcome::GaveUp, None),
                (true, false) => (free, Outcome::WonPart, None),
                (false, _) => (free, Outcome::Won, None),
            };
        };
        let (why, by) = if candidate.suppressed.contains(first) {
            (Outcome::Suppressed, Some(state.rules[usize::from(candidate.suppressor)].slot))
        } else if self.taken.contains(first) {
            (Outcome::Outranked, decision.source[first as usize])
        } else {
            let reserver = usize::from(self.reserver[first as usize]);
            (Outcome::Waiting, Some(state.rules[reserver].slot))
        };
        if free.is_empty() {
            (free, why, by)
        } else if proposal.coupled == 0 {
            (free, Outcome::WonPart, by)
        } else {
            (Axes::NONE, if why == Outcome::Waiting { why } else { Outcome::GaveUp }, by)
        }
    }

    /// Time that the driver in `row` still waits for the first reserved axis that it claims.
    fn waiting_time(&self, state: &ArbiterState, row: usize, now: Time) -> Remaining {
        let first = state.candidates[row].axes.intersection(self.reserved).iter().next();
        let until = first
            .map(|axis| state.dwell_timers[usize::from(self.reserver[axis as usize])].until[axis as usize]);
        until.map_or(Remaining::Now, |until| Remaining::until(until, now))
    }

    /// Reserves the axes that the behavior in `row` drove less than its dwell time ago.
    fn reserve(&mut self, row: u16, state: &ArbiterState, now: Time) {
        for axis in Axis::ALL {
            if now < state.dwell_timers[usize::from(row)].until[axis as usize]
                && !self.reserved.contains(axis)
            {
                self.reserved = self.reserved.union(axis.into());
                self.reserver[axis as usize] = row;
            }
        }
    }
}

impl DwellTimer {
    fn extend(&mut self, axes: Axes, until: Time) {
        for axis in axes.iter() {
            self.until[axis as usize] = until;
        }
    }
}
