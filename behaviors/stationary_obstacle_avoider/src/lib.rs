//! Around what stands in the way: the state machine between vision and sonar.

pub mod halt_state_machine;
