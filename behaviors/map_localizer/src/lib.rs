//! Finds the robot on a wire-frame map, and follows a planned path to a goal.

pub mod association;
pub mod belief;
pub mod fix;
pub mod history;
pub mod matching;
pub mod motion;
pub mod projected_line;
