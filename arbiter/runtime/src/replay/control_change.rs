//! Changes of control between two sides of a what-if: when, on which axis, by how much, and who drove instead.

use serde::Serialize;
use yamabico_arbiter::decide::{Explanation, explain};
use yamabico_core::time::Time;

use super::comparison::Side;

/// Longest gap between two differing decisions of one change.
const MAX_GAP_S: f64 = 0.5;
/// Maximum number of changes that are listed.
const MAX_CHANGES: usize = 1000;

/// Time in which the decisions of both sides differ on one axis, with the same behaviors in control.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ControlChange {
    /// Time of the first differing decision, s.
    pub from_s: f64,
    /// Time of the last one, s.
    pub to_s: f64,
    /// Number of differing decisions.
    pub decisions: u64,
    /// Axis.
    pub axis: &'static str,
    /// Unit of the speeds.
    pub unit: &'static str,
    /// Behavior that drove the axis in the recording; empty if none.
    pub recorded_winner: String,
    /// Behavior that drives it in the replay; empty if none.
    pub winner: String,
    /// Largest difference of the commanded speeds.
    pub max_difference: f64,
    /// Steps to the recorded speed, at the first differing decision.
    pub recorded_why: String,
    /// Steps to the replayed speed, likewise.
    pub why: String,
}

/// Collects the changes, decision by decision.
#[derive(Debug, Default)]
pub(super) struct ControlChanges {
    pub changes: Vec<ControlChange>,
    /// Number of pairs of decisions, and of those that differ.
    pub decisions: u64,
    pub differing: u64,
}

impl ControlChanges {
    /// Compares the newest decisions of both sides at `time`.
    pub fn compare(&mut self, time: Time, recorded: &Side, replayed: &Side) {
        let (Some(before), Some(after)) = (&recorded.decision, &replayed.decision) else { return };
        self.decisions += 1;
        let mut explained: Option<(Explanation, Explanation)> = None;
        let mut differs = false;
        for axis in before.header.axes.iter() {
            let index = axis as usize;
            let winners = [before, after].map(|decision| decision.header.source[index]);
            let speeds = [before, after].map(|decision| decision.header.commanded.get(axis));
            if winners[0] == winners[1] && speeds[0].to_bits() == speeds[1].to_bits() {
                continue;
            }
            differs = true;
            let (now_s, difference) = (time.as_secs_f64(), (speeds[1] - speeds[0]).abs());
            let known = self.changes.iter_mut().rev().find(|change| {
                change.axis == axis.as_str()
                    && change.recorded_winner == winners[0].as_str()
                    && change.winner == winners[1].as_str()
                    && now_s - change.to_s <= MAX_GAP_S
            });
            if let Some(change) = known {
                change.to_s = now_s;
                change.decisions += 1;
                change.max_difference = change.max_difference.max(difference);
                continue;
            }
            if self.changes.len() >= MAX_CHANGES {
                continue;
            }
            let (a, b) = explained.get_or_insert_with(|| {
                (explain(before, &recorded.context), explain(after, &replayed.context))
            });
            let why = |explanation: &Explanation| {
                let found = explanation.axes.iter().find(|entry| entry.axis == axis.as_str());
                found.map_or_else(String::new, |entry| entry.why.join("; "))
            };
            let unit = a.axes.iter().find(|entry| entry.axis == axis.as_str()).map_or("", |entry| entry.unit);
            self.changes.push(ControlChange {
                from_s: now_s,
                to_s: now_s,
                decisions: 1,
                axis: axis.as_str(),
                unit,
                recorded_winner: winners[0].to_string(),
                winner: winners[1].to_string(),
                max_difference: difference,
                recorded_why: why(a),
                why: why(b),
            });
        }
        self.differing += u64::from(differs);
    }
}
