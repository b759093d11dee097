//! Decides which proposal the motors get: arbitration, safety, execution, recording.

pub mod decide;
pub mod execution;
pub mod kinematics;
pub mod operator;
pub mod policy;
pub mod ramp;
pub mod record;
pub mod report;
pub mod run;
pub mod safety;
pub mod supervisor;
