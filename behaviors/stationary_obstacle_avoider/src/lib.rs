//! Around what stands in the way: the state machine between vision and sonar.

pub mod halt_state_machine;
pub mod obstacle_regions;
pub mod safe_passage;
pub mod threshold_learning;
