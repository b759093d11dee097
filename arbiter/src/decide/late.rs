//! Between steps 5 and 8: winners whose sensor data is older than their latency budget.

use std::time::Duration;

use yamabico_core::message::Proposal;
use yamabico_core::time::Time;

use super::decision::{Decision, Late};
use super::state::State;
use crate::policy::{Lateness, Policy};

/// Notes the winner that exceeds its latency budget by the largest ratio; what it leaves of the robot's largest speeds, 1
/// where nobody is late or lateness is only counted.
///
/// The share is that of the budget in the age, so that the way that is driven blindly stays what it is at full speed with
/// data as old as the budget.
pub(super) fn note(
    policy: &Policy,
    state: &State,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) -> f64 {
    if !state.has_budgets {
        return 1.0;
    }
    let mut least = 1.0;
    for &row in &state.drivers {
        let slot = usize::from(state.rules[usize::from(row)].slot);
        let Some(budget) = policy.behaviors[slot].latency_budget else { continue };
        let Some(proposal) = proposals.get(slot).and_then(Option::as_ref) else { continue };
        let age = now.since(Time(proposal.evidence_ns));
        if decision.rulings[slot].won.is_empty() || age <= budget {
            continue;
        }
        let share = share_of(budget, age);
        if share < least {
            least = share;
            decision.late = Some(Late { behavior: slot as u16, age, factor: share });
        }
    }
    if policy.lateness == Lateness::Counts {
        decision.late = decision.late.map(|late| Late { factor: 1.0, ..late });
        least = 1.0;
    }
    least
}

fn share_of(budget: Duration, age: Duration) -> f64 {
    budget.as_secs_f64() / age.as_secs_f64()
}
