//! The decision: one command and a verdict on each behavior.
//!
//! [`decide`] is a pure function of the newest proposals, the state and the time: it reads no clock, does no input or
//! output, allocates nothing and cannot fail. Every call gives a command.

mod allocation;
mod decision;
mod decision_message;
mod explain;
mod latency;
mod restraints;
mod screening;
mod state;
mod wires;

pub use decision::{Decision, LateData, Remaining, Ruling};
pub use decision_message::DecisionMessage;
pub use explain::{
    AxisExplanation, BehaviorExplanation, ExplainContext, Explanation, ProposalTerms, explain,
};
pub use state::ArbiterState;

use yamabico_core::message::{Axes, Mode, Proposal, Twist};
use yamabico_core::time::Time;

use crate::policy::Policy;
use crate::ramp::Step;
use crate::safety::{Stop, Tick};

/// Decides on the command at `now`.
///
/// `proposals` holds the newest proposal of each behavior at the behavior's index in `policy`; a missing or empty slot is
/// silence. `state` must come from the same policy. `decision` is overwritten.
///
/// 1. A drive proposal that is disabled, stale or malformed is dropped; such a halt still halts, such a limit is zero.
/// 2. Wires inhibit drive proposals, or suppress axes of them.
/// 3. Halts stop the axes that they name.
/// 4. Limits combine to their minimum on each axis, as far as the motion points into their sectors.
/// 5. Each axis goes to the highest-priority drive proposal that claims it; a coupled drive gets all of its axes or none.
/// 6. An axis that no behavior claims slows to zero.
/// 7. A critical behavior or sensor that is silent, the emergency stop, and a clock that runs backwards stop the robot.
/// 8. The result is cut to the robot's limits, ramped by acceleration and jerk, and commanded.
///
/// No failure raises a speed.
pub fn decide(
    policy: &Policy,
    state: &mut ArbiterState,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) {
    let tick = state.clock.advance(now, policy);
    decision.begin(policy, now, state.next_sequence());
    screening::screen(state, proposals, tick.now, decision);
    wires::apply(state, tick.now, decision);
    restraints::find_halts(state, decision);
    allocation::allocate(state, proposals, tick.now, decision);
    let share = latency::check(policy, state, proposals, tick.now, decision);
    decision.feasible = within_limits(policy, state.ramp.velocity(), decision.wanted, share);
    decision.allowed = restraints::apply(state, tick.now, decision.feasible, decision);
    decision.stop = stop(state, &tick);
    restraints::revoke_stopped_axes(state, decision);
    decision.commanded = ramp(policy, state, &tick, decision);
    decision.mode = mode(decision);
}

/// Cuts `wanted` to `share` of the robot's maximum speeds, keeping the direction of its translation, and to what the wheels
/// can reach.
fn within_limits(policy: &Policy, current: Twist, wanted: Twist, share: f64) -> Twist {
    let [linear, lateral, angular] = policy.limits.speed.map(|speed| share * speed);
    let slowed = restraints::limited_to(wanted, Axes::ALL, Twist { linear, lateral, angular });
    policy.kinematics.reachable(slowed, current)
}

/// Finds what stops the whole robot, the most severe cause first.
fn stop(state: &ArbiterState, tick: &Tick) -> Option<Stop> {
    match state.stop_requests.requested() {
        Some(Stop::EmergencyStop) => Some(Stop::EmergencyStop),
        requested => {
            let silent = if tick.backwards { Some(Stop::Clock) } else { state.silent_part(tick.now) };
            silent.or(requested)
        }
    }
}

/// Ramps one step towards the allowed twist; halted axes and emergencies brake with the emergency deceleration.
fn ramp(policy: &Policy, state: &mut ArbiterState, tick: &Tick, decision: &mut Decision) -> Twist {
    let stops_everything = decision.stop.is_some_and(Stop::is_emergency);
    let emergency = if stops_everything { Axes::ALL } else { decision.halted };
    decision.emergency = !emergency.is_empty();
    let step = Step { braking_s: tick.braking_s, speeding_s: tick.speeding_s, emergency };
    state.ramp.advance(decision.allowed, step, &policy.limits, policy.axes())
}

fn mode(decision: &Decision) -> Mode {
    match decision.stop {
        Some(Stop::EmergencyStop) => Mode::EmergencyStop,
        Some(Stop::ShuttingDown) => Mode::ShuttingDown,
        Some(Stop::Behavior(_) | Stop::Sensor(_) | Stop::Clock) => Mode::CriticalSilent,
        None if !decision.halted.is_empty() => Mode::Halted,
        None if decision.source.iter().any(Option::is_some) => Mode::Driving,
        None => Mode::Idle,
    }
}
