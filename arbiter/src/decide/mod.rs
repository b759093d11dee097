//! The decision: from the newest proposals, what came before, and the time, to one command and a verdict on everybody.
//!
//! [`decide`] is a pure function of its arguments: it reads no clock, does no input or output, allocates nothing, and
//! cannot fail. Every call gives a command.

mod contest;
mod decision;
mod explain;
mod hear;
mod late;
mod restrain;
mod state;
mod told;
mod wires;

pub use decision::{Decision, Lasting, Late, Ruling};
pub use explain::{AxisWords, BehaviorWords, Explanation, Scene, Terms, explain};
pub use state::State;
pub use told::Told;

use yamabico_core::message::{Axes, Mode, Proposal, Twist};
use yamabico_core::time::Time;

use crate::policy::Policy;
use crate::ramp::Step;
use crate::safety::{Stop, Tick};

/// Decides what the motors get at `now`.
///
/// `proposals` holds the newest proposal of each behavior at the behavior's index in `policy`; a missing or empty slot is
/// silence. `state` must have been made from the same policy. `decision` is overwritten.
///
/// No failure raises a speed: whatever is stale, malformed, silent or out of time is dropped as a drive and kept as a halt
/// or as a limit of zero.
pub fn decide(
    policy: &Policy,
    state: &mut State,
    proposals: &[Option<Proposal>],
    now: Time,
    decision: &mut Decision,
) {
    let tick = state.course.advance(now, policy);
    decision.begin(policy, now, state.next_sequence());
    hear::hear(state, proposals, tick.now, decision);
    wires::apply(state, tick.now, decision);
    restrain::halt(state, decision);
    contest::award(state, proposals, tick.now, decision);
    let share = late::note(policy, state, proposals, tick.now, decision);
    decision.feasible = within_limits(policy, state.ramp.velocity(), decision.wanted, share);
    decision.allowed = restrain::restrain(state, tick.now, decision.feasible, decision);
    decision.stop = stop(state, &tick);
    restrain::stop_drivers(state, decision);
    decision.commanded = ramp(policy, state, &tick, decision);
    decision.mode = mode(decision);
}

/// `wanted` cut to a share of the robot's largest speeds, its translation in the same direction, and to what the wheels can
/// roll.
fn within_limits(policy: &Policy, current: Twist, wanted: Twist, share: f64) -> Twist {
    let [linear, lateral, angular] = policy.limits.speed.map(|speed| share * speed);
    let slowed = restrain::limited_to(wanted, Axes::ALL, Twist { linear, lateral, angular });
    policy.kinematics.reachable(slowed, current)
}

/// What stops the whole robot, the most severe first.
fn stop(state: &State, tick: &Tick) -> Option<Stop> {
    match state.orders.stop_ordered() {
        Some(Stop::EmergencyStop) => Some(Stop::EmergencyStop),
        ordered => {
            let silent = if tick.backwards { Some(Stop::Clock) } else { state.silent_part(tick.now) };
            silent.or(ordered)
        }
    }
}

/// Goes one step towards what is allowed; halted axes and emergencies brake as hard as the robot can.
fn ramp(policy: &Policy, state: &mut State, tick: &Tick, decision: &mut Decision) -> Twist {
    let everything = decision.stop.is_some_and(Stop::is_emergency);
    let emergency = if everything { Axes::ALL } else { decision.halted };
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
