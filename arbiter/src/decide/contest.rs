//! Step 5: which drive proposal gets which axis.

use std::ops::Range;

use yamabico_core::message::{Axes, Axis, Outcome, Proposal};
use yamabico_core::time::Time;

use super::decision::{Decision, Lasting};
use super::hear::Hearing;
use super::state::State;

/// Until when lower priorities wait for each axis that a behavior drove.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tenure {
    until: [Time; 3],
}

/// What is given away while the rows are asked in turn.
#[derive(Default)]
struct Board {
    /// Driven by a higher priority.
    taken: Axes,
    /// Slot of who drives every axis that the drive has, where that is one.
    holder: Option<u16>,
    /// Left by a higher priority a moment ago.
    reserved: Axes,
    /// Row that left each reserved axis.
    reserver: [u16; 3],
}

/// The confidence-weighted mean of the proposals for one axis.
#[derive(Clone, Copy, Default)]
struct Share {
    count: u32,
    weights: f64,
    weighted: f64,
    sum: f64,
    /// Slot and confidence of the most confident.
    leader: Option<(u16, f64)>,
}

impl Share {
    fn add(&mut self, slot: u16, speed: f64, confidence: f64) {
        self.count += 1;
        self.weights += confidence;
        self.weighted += confidence * speed;
        self.sum += speed;
        if self.leader.is_none_or(|(_, most)| confidence > most) {
            self.leader = Some((slot, confidence));
        }
    }

    /// The speed of a single one; the mean of several, the plain one where no confidence tells them apart.
    fn speed(&self) -> f64 {
        if self.count > 1 && self.weights > 0.0 {
            self.weighted / self.weights
        } else {
            self.sum / f64::from(self.count)
        }
    }
}

/// Gives each axis to the highest priority that claims it, into `decision.wanted` and `decision.source`.
pub(super) fn award(state: &mut State, proposals: &[Option<Proposal>], now: Time, decision: &mut Decision) {
    let mut board = Board::default();
    let (mut next, mut next_dweller) = (0, 0);
    while next < state.drivers.len() {
        let row = usize::from(state.drivers[next]);
        let rule = &state.rules[row];
        if board.turns_down(&state.hearings[row]) {
            let ruling = &mut decision.rulings[usize::from(rule.slot)];
            (ruling.outcome, ruling.by) = (Outcome::OutRanked, board.holder);
            next += 1;
            continue;
        }
        while next_dweller < state.dwellers.len() && state.dwellers[next_dweller] < rule.group_start {
            board.reserve(state.dwellers[next_dweller], state, now);
            next_dweller += 1;
        }
        let end = next + state.drivers[next..].iter().take_while(|&&row| row < rule.group_end).count();
        award_group(state, proposals, next..end, now, &mut board, decision);
        if board.taken == state.has {
            board.holder = one_of(&decision.source);
        }
        next = end;
    }
}

/// The drivers in `range`, all of one priority, share what is free.
fn award_group(
    state: &mut State,
    proposals: &[Option<Proposal>],
    range: Range<usize>,
    now: Time,
    board: &mut Board,
    decision: &mut Decision,
) {
    let mut shares = [Share::default(); 3];
    for i in range.clone() {
        let row = usize::from(state.drivers[i]);
        let slot = state.rules[row].slot;
        let Some(proposal) = proposals.get(usize::from(slot)).and_then(Option::as_ref) else { continue };
        if !state.hearings[row].drives {
            continue;
        }
        let (won, outcome, by) = board.bid(state, row, proposal, decision);
        for axis in won.iter() {
            shares[axis as usize].add(slot, proposal.twist.get(axis), proposal.confidence);
        }
        if !won.is_empty() {
            let evidence = Time(proposal.evidence_ns);
            if decision.evidence_of.is_none() || evidence < decision.evidence {
                decision.evidence_of = Some(slot);
            }
            decision.evidence = decision.evidence.min(evidence);
            state.tenures[row].extend(won, Time(now.0.saturating_add(state.rules[row].dwell_ns)));
        }
        let ruling = &mut decision.rulings[usize::from(slot)];
        (ruling.won, ruling.outcome, ruling.by) = (won, outcome, by);
        match outcome {
            Outcome::Suppressed | Outcome::GaveUp | Outcome::WonPart => {}
            Outcome::Waiting => ruling.lasts = board.wait(state, row, now),
            _ => ruling.lasts = Lasting::Now,
        }
    }
    for axis in Axis::ALL {
        let share = &shares[axis as usize];
        if let Some((leader, _)) = share.leader {
            board.taken = board.taken.union(axis.into());
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

/// The only one among `slots`; `None` where there are several.
fn one_of(slots: &[Option<u16>; 3]) -> Option<u16> {
    let mut some = slots.iter().flatten();
    let first = some.next().copied();
    if some.all(|slot| Some(*slot) == first) { first } else { None }
}

impl Board {
    /// Whether it is plain that the driver gets nothing, since one other has everything: the common case, decided without
    /// a look at the proposal.
    fn turns_down(&self, hearing: &Hearing) -> bool {
        self.holder.is_some() && hearing.drives && !hearing.named.is_empty() && hearing.suppressed.is_empty()
    }

    /// What the driver in `row` gets of the axes that it claims, the outcome, and who kept the rest from it.
    fn bid(
        &self,
        state: &State,
        row: usize,
        proposal: &Proposal,
        decision: &Decision,
    ) -> (Axes, Outcome, Option<u16>) {
        let hearing = &state.hearings[row];
        let free = hearing.named.without(hearing.suppressed).without(self.taken).without(self.reserved);
        let lost = hearing.named.without(free);
        let beyond = proposal.axes.without(state.has);
        if lost.is_empty() && beyond.is_empty() && decision.halted.is_empty() {
            return (free, Outcome::Won, None);
        }
        // What a halt leaves of a coupled motion would be an arc that nobody proposed. Where it leaves nothing, the motion
        // is stopped as a whole.
        let cut = decision.halted.intersection(free).iter().find(|&axis| proposal.twist.get(axis) != 0.0);
        if let (Some(axis), true) = (cut, proposal.coupled != 0 && !free.without(decision.halted).is_empty())
        {
            return (Axes::NONE, Outcome::GaveUp, decision.halted_by[axis as usize]);
        }
        // A motion along an axis that the drive lacks is lost, too.
        let impossible = beyond.iter().any(|axis| proposal.twist.get(axis) != 0.0);
        let Some(first) = lost.iter().next() else {
            return match (impossible, proposal.coupled != 0) {
                _ if free.is_empty() => (free, Outcome::OutRanked, None),
                (true, true) => (Axes::NONE, Outcome::GaveUp, None),
                (true, false) => (free, Outcome::WonPart, None),
                (false, _) => (free, Outcome::Won, None),
            };
        };
        let (why, by) = if hearing.suppressed.contains(first) {
            (Outcome::Suppressed, Some(state.rules[usize::from(hearing.suppressor)].slot))
        } else if self.taken.contains(first) {
            (Outcome::OutRanked, decision.source[first as usize])
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

    /// How long the driver in `row` waits for the first reserved axis that it claims.
    fn wait(&self, state: &State, row: usize, now: Time) -> Lasting {
        let first = state.hearings[row].named.intersection(self.reserved).iter().next();
        let until =
            first.map(|axis| state.tenures[usize::from(self.reserver[axis as usize])].until[axis as usize]);
        until.map_or(Lasting::Now, |until| Lasting::until(until, now))
    }

    /// Keeps lower priorities from what the behavior in `row` drove a moment ago.
    fn reserve(&mut self, row: u16, state: &State, now: Time) {
        for axis in Axis::ALL {
            if now < state.tenures[usize::from(row)].until[axis as usize] && !self.reserved.contains(axis) {
                self.reserved = self.reserved.union(axis.into());
                self.reserver[axis as usize] = row;
            }
        }
    }
}

impl Tenure {
    fn extend(&mut self, axes: Axes, until: Time) {
        for axis in axes.iter() {
            self.until[axis as usize] = until;
        }
    }
}
