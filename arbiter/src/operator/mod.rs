//! Somebody outside a running robot: sends it to goals, switches its behaviours, stops it.

mod desk;
mod goal;

pub use desk::{Desk, Obeyed, Request, RequestError};
pub use goal::{GoalError, Operator, Place};
