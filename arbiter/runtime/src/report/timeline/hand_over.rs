//! Hand-overs: changes of the behaviors that drive, and why.

use std::collections::BTreeMap;

use yamabico_core::message::{Axis, DecisionHeader, Kind, Outcome, Proposal, Reason, Verdict};

use super::span::Holder;

/// Finds the hand-overs of a run from its proposals and decisions.
#[derive(Clone, Debug, Default)]
pub(super) struct HandOvers {
    proposals: BTreeMap<String, Proposal>,
    drivers: Option<[String; 3]>,
}

impl HandOvers {
    /// Takes in the next proposal.
    pub fn proposal(&mut self, proposal: Proposal) {
        self.proposals.insert(proposal.behavior.as_str().to_owned(), proposal);
    }

    /// Takes in the next decision; returns a sentence for each behavior that takes axes with it. A halt changes nothing: who would
    /// drive without it does not drive.
    pub fn decision(&mut self, header: &DecisionHeader, verdicts: &[Verdict]) -> Vec<String> {
        let drivers = Axis::ALL.map(|axis| match (Holder::of(header, axis), &self.drivers) {
            (Holder::Halt(_), Some(before)) => before[axis as usize].clone(),
            (Holder::Halt(_), None) => String::new(),
            _ => header.source[axis as usize].as_str().to_owned(),
        });
        let mut sentences = Vec::new();
        if drivers.iter().all(String::is_empty) || self.drivers.as_ref() == Some(&drivers) {
            return sentences;
        }
        let before = self.drivers.replace(drivers.clone()).unwrap_or_default();
        for (index, taker) in drivers.iter().enumerate() {
            // One sentence for each behavior that takes axes, at its first axis.
            let is_taken = |axis: usize| drivers[axis] == *taker && before[axis] != *taker;
            if taker.is_empty() || !is_taken(index) || (0..index).any(is_taken) {
                continue;
            }
            let axes = Axis::ALL.into_iter().filter(|axis| is_taken(*axis as usize));
            let axes: Vec<_> = axes.map(Axis::as_str).collect();
            let loser = &before[index];
            let from = if loser.is_empty() { String::new() } else { format!(" from {loser}") };
            let why = self.why(taker, loser, verdicts);
            sentences.push(format!("{taker} took {}{from}{why}", axes.join(" and ")));
        }
        sentences
    }

    /// Explains a hand-over by the proposals of both behaviors.
    fn why(&self, taker: &str, loser: &str, verdicts: &[Verdict]) -> String {
        let verdict = |name: &str| verdicts.iter().find(|verdict| verdict.behavior.as_str() == name);
        let priority = |name: &str| verdict(name).map(|verdict| verdict.priority);
        let outranks = !loser.is_empty() && priority(taker) > priority(loser);
        if !outranks && let Some(fault) = verdict(loser).and_then(Verdict::outcome).filter(is_fault) {
            return format!(": {loser} is {fault}");
        }
        let gave_up = self.proposals.get(loser).filter(|proposal| proposal.kind() == Some(Kind::Abstain));
        let cause = if outranks { None } else { gave_up.map(|proposal| (loser, proposal)) };
        let cause = cause.or_else(|| Some((taker, self.proposals.get(taker)?)));
        cause.map_or_else(String::new, |(name, proposal)| match because(proposal) {
            text if text.is_empty() => String::new(),
            text if name == loser => format!(": {loser} abstains, {text}"),
            text => format!(": {text}"),
        })
    }
}

/// True if a behavior with this outcome has a proposal that does not count.
fn is_fault(outcome: &Outcome) -> bool {
    use Outcome::{Disabled, FromTheFuture, Inhibited, Malformed, Silent, Stale, StaleEvidence, Suppressed};
    let faults = [Silent, Disabled, Stale, StaleEvidence, FromTheFuture, Malformed, Inhibited, Suppressed];
    faults.contains(outcome)
}

/// Reason and note of a proposal; empty if it has neither.
pub(in super::super) fn because(proposal: &Proposal) -> String {
    let reason = proposal.reason().filter(|reason| ![Reason::None, Reason::Nominal].contains(reason));
    let (reason, note) = (reason.map_or("", Reason::as_str), proposal.note.as_str());
    match (reason, note) {
        ("", note) => note.to_owned(),
        (reason, "") => reason.to_owned(),
        (reason, note) if note.starts_with(reason) => note.to_owned(),
        (reason, note) => format!("{reason}, {note}"),
    }
}
