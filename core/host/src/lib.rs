//! Where a plugin works: fed from the bus, asked or polled when it is due, what it says sent on.
//!
//! The same seats and the same loops serve a plugin in lockstep, on a thread, and in a process of its own.

mod behavior;
pub mod bus;
pub mod config;
mod device;
mod durations;
mod feed;
mod ports;
pub mod process;
mod pulse;
mod rebuild;
mod scheduling;
pub mod topics;
mod tuner;
mod turns;
mod work;

pub use behavior::{BehaviorPlan, BehaviorRecord, BehaviorSeat, Hosting, SeatError};
pub use device::{DevicePlan, DeviceSeat, panicked};
pub use durations::Durations;
pub use pulse::{MAX_CORNERS, MAX_WORDS, Pulse};
pub use scheduling::{NotScheduled, Processors, Scheduling};
pub use tuner::MAX_PARAMETERS;
pub use turns::{ClockSeat, TurnSeat, behave_in_turn, keep_the_clock};
pub use work::{behave, operate};
