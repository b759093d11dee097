//! Who runs when: in lockstep with simulated time, or live.

mod arbiter_seat;
mod behavior_seat;
mod course;
mod crew;
mod device_seat;
mod durations;
mod feed;
mod live;
mod lockstep;
mod plan;
mod ports;
mod referee;
pub mod topics;

pub use arbiter_seat::ArbiterSeat;
pub use behavior_seat::{BehaviorPlan, BehaviorRecord, SeatError};
pub use course::{End, Progress, run_lockstep};
pub use device_seat::DevicePlan;
pub use durations::Durations;
pub use live::{Live, monotonic_now};
pub use lockstep::{Lockstep, Supply};
pub use plan::{Plan, Topic};
pub use referee::Referee;
