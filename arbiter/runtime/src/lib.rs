//! Runs a robot: execution, supervision, recording, reports, and the client of a running robot.

pub mod execution;
pub mod operator;
pub mod record;
pub mod report;
pub mod run;
pub mod supervisor;
