//! Decides which proposal the motors get, and explains why: pure functions of proposals, state and time.

pub mod decide;
pub mod kinematics;
pub mod policy;
pub mod ramp;
pub mod safety;
