//! Decides which proposal the motors get, and explains why.
//!
//! Everything here is a pure function of proposals, state and time: no clock, no input or output, no allocation after start.
//!
//! | module | contents |
//! |---|---|
//! | [`decide`] | [`decide::decide`], which turns proposals into a command and verdicts, and [`decide::explain`] |
//! | [`policy`] | the settings of a decision: priorities, ages, wires, limits |
//! | [`safety`] | the stops that no behavior can override |
//! | [`ramp`] | acceleration and jerk limits |
//! | [`kinematics`] | wheel speeds of differential and omnidirectional drives |
//!
//! ```
//! use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
//! use yamabico_arbiter::kinematics::Kinematics;
//! use yamabico_arbiter::policy::{BehaviorPolicy, Policy};
//! use yamabico_core::message::{Axes, Proposal, Twist};
//! use yamabico_core::{sensor::MotionLimits, time::Time};
//!
//! let behaviors = vec![BehaviorPolicy::new("wall-follower", 10)];
//! let policy = Policy::new(MotionLimits::default(), Kinematics::Body { axes: Axes::PLANAR }, behaviors);
//! let (mut state, mut decision) = (ArbiterState::new(&policy), Decision::new(&policy));
//! let forward = Proposal::drive(Axes::PLANAR, Twist::planar(0.2, 0.0));
//! decide(&policy, &mut state, &[Some(forward)], Time::ZERO, &mut decision);
//! let command = decision.command(&policy);
//! assert!(command.twist.linear > 0.0 && command.source[0].as_str() == "wall-follower");
//! ```

pub mod decide;
pub mod kinematics;
pub mod policy;
pub mod ramp;
pub mod safety;
