//! Log of control: who took an axis from whom, and why.

use std::collections::HashMap;

use yamabico_core::message::{Axes, Axis, DecisionHeader, Name, Outcome, Proposal, Reason, Verdict};

/// Axes in the order of a decision's sources.
const AXES: [Axes; 3] = [Axes::LINEAR, Axes::LATERAL, Axes::ANGULAR];

/// Sentences for changes of the behavior in control of an axis.
#[derive(Default)]
pub(super) struct ControlLog {
    sources: [Name; 3],
    /// Reason of the newest proposal of each behavior, as it says it.
    reasons: HashMap<Name, String>,
}

impl ControlLog {
    /// Takes in the reason of a proposal.
    pub fn proposal(&mut self, proposal: &Proposal) {
        let note = proposal.note.as_str();
        let reason = || proposal.reason().map_or("unknown reason", Reason::as_str);
        let text = if note.is_empty() { reason() } else { note };
        let known = self.reasons.entry(proposal.behavior).or_default();
        if known != text {
            text.clone_into(known);
        }
    }

    /// Author and sentence for each pair of behaviors between which control changed, such as `avoider` and `took linear and
    /// angular from localizer (outranked): obstacle at 1.6 m`.
    pub fn decision(&mut self, decision: &DecisionHeader, verdicts: &[Verdict]) -> Vec<(Name, String)> {
        let before = std::mem::replace(&mut self.sources, decision.source);
        let mut changes: Vec<(Name, Name, Axes)> = Vec::new();
        for ((old, new), axis) in before.into_iter().zip(decision.source).zip(AXES) {
            if old == new {
                continue;
            }
            match changes.iter_mut().find(|(from, to, _)| (*from, *to) == (old, new)) {
                Some((.., axes)) => *axes = axes.union(axis),
                None => changes.push((old, new, axis)),
            }
        }
        let outcome = |name: Name| {
            let verdict = verdicts.iter().find(|verdict| verdict.behavior == name);
            verdict.and_then(Verdict::outcome).map_or("gone", Outcome::as_str)
        };
        let reason = |name: Name| self.reasons.get(&name).map_or("", String::as_str);
        let because = |reason: &str| if reason.is_empty() { String::new() } else { format!(": {reason}") };
        let sentence = |(old, new, axes): (Name, Name, Axes)| {
            let axes = named(axes);
            match (old.is_empty(), new.is_empty()) {
                (true, _) => (new, format!("took {axes}{}", because(reason(new)))),
                (_, true) => (old, format!("released {axes} ({}){}", outcome(old), because(reason(old)))),
                _ => (new, format!("took {axes} from {old} ({}){}", outcome(old), because(reason(new)))),
            }
        };
        changes.into_iter().map(sentence).collect()
    }
}

/// Names of axes, such as `linear and angular`.
fn named(axes: Axes) -> String {
    let names: Vec<&str> = axes.iter().map(Axis::as_str).collect();
    match names.as_slice() {
        [names @ .., last] if !names.is_empty() => format!("{} and {last}", names.join(", ")),
        names => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Twist;

    fn drives(name: &str, note: &str) -> Proposal {
        let drive = Proposal::drive(Axes::PLANAR, Twist::planar(0.3, 0.0)).with_note(format_args!("{note}"));
        Proposal { behavior: Name::new(name), ..drive }
    }

    fn decision(linear: &str, angular: &str) -> DecisionHeader {
        let source = [Name::new(linear), Name::default(), Name::new(angular)];
        DecisionHeader { source, ..DecisionHeader::default() }
    }

    fn lost(name: &str, outcome: Outcome) -> Verdict {
        Verdict { behavior: Name::new(name), outcome: outcome.code(), ..Verdict::default() }
    }

    #[test]
    fn a_change_of_control_is_a_sentence() {
        let mut log = ControlLog::default();
        log.proposal(&drives("localizer", "on the path"));
        log.proposal(&drives("avoider", "obstacle at 1.6 m"));
        let mut said = |decision: &DecisionHeader, verdicts: &[Verdict]| -> Vec<String> {
            let changes = log.decision(decision, verdicts);
            changes.into_iter().map(|(who, text)| format!("{who} {text}")).collect()
        };
        let localizer = decision("localizer", "localizer");
        assert_eq!(said(&localizer, &[]), ["localizer took linear and angular: on the path"]);
        assert!(said(&localizer, &[]).is_empty(), "the same again is no news");
        assert_eq!(
            said(&decision("avoider", "avoider"), &[lost("localizer", Outcome::Outranked)]),
            ["avoider took linear and angular from localizer (outranked): obstacle at 1.6 m"]
        );
        assert_eq!(
            said(&decision("avoider", ""), &[lost("avoider", Outcome::WonPart)]),
            ["avoider released angular (won in part): obstacle at 1.6 m"]
        );
    }
}
