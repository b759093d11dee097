//! After step 5: winners whose sensor data is older than their latency budget.

use std::time::Duration;

use yamabico_core::message::Proposal;
use yamabico_core::time::Time;

use super::decision::{Decision, LateData};
use super::state::ArbiterState;
use crate::policy::{LatencyPolicy, Policy};

/// Records the winner that exceeds its latency budget by the largest ratio. Returns the share of the robot's maximum speeds
/// that remains: 1 if no winner is late, or if late data is only counted.
///
/// The share is budget divided by age: so the distance driven on old data is at most the distance that full speed covers
/// within the budget.
pub(super) fn check(
    policy: &Policy,
    state: &ArbiterState,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) -> f64 {
    if !state.has_budgets {
        return 1.0;
    }
    let mut smallest = 1.0;
    for &row in &state.drivers {
        let slot = usize::from(state.rules[usize::from(row)].slot);
        let Some(budget) = policy.behaviors[slot].latency_budget else { continue };
        let Some(proposal) = proposals.get(slot).and_then(Option::as_ref) else { continue };
        let age = now.since(Time(proposal.evidence_ns));
        if decision.rulings[slot].won.is_empty() || age <= budget {
            continue;
        }
        let share = share_of(budget, age);
        if share < smallest {
            smallest = share;
            decision.late = Some(LateData { behavior: slot as u16, age, factor: share });
        }
    }
    if policy.latency_policy == LatencyPolicy::Count {
        decision.late = decision.late.map(|late| LateData { factor: 1.0, ..late });
        smallest = 1.0;
    }
    smallest
}

fn share_of(budget: Duration, age: Duration) -> f64 {
    budget.as_secs_f64() / age.as_secs_f64()
}
