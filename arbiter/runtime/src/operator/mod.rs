//! Somebody outside a running robot: sends it to goals, switches its behaviors, stops it, and looks at what it does.

mod desk;
mod goal;
mod listener;
mod lookout;
mod muster;
mod tuning;

pub use desk::{Desk, Obeyed, Request, RequestError};
pub use goal::{GoalError, Operator, Place};
pub use listener::{Figures, Heard, ListenError, Listener, Window};
pub use lookout::{LookError, Lookout};
pub use muster::{Calls, Mustered, Word, muster};
pub use tuning::{RetuneError, retune};
