//! Decides which proposal the motors get: arbitration, safety, execution, recording.

pub mod record;
pub mod report;
