//! Who runs when: in lockstep with simulated time, or live.

mod apart;
mod arbiter_seat;
mod course;
mod crew;
mod fared;
mod live;
mod lockstep;
mod paced;
mod plan;
mod referee;
mod retuning;
mod roll;
mod roster;
mod seats;

pub use arbiter_seat::ArbiterSeat;
pub use course::{End, Progress, run_lockstep};
pub use fared::Fared;
pub use live::Live;
pub use lockstep::{Lockstep, Supply};
pub use plan::{Plan, Topic};
pub use referee::Referee;
pub use roster::{Duties, Enrolled, Posted, Roster};
pub use yamabico_host::{BehaviorPlan, BehaviorRecord, DevicePlan, Durations, SeatError, topics};
