//! The integration tests of this crate, one module for each subject.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod broken_recordings;
mod calibrate;
mod chaos;
mod devices;
mod documents;
mod goto;
mod hangs;
mod info;
mod learn_floor;
mod learn_map;
mod learn_thresholds;
mod live_control;
mod lost_messages;
mod one_task;
mod parameter_tables;
mod program;
mod python;
mod replay;
mod report;
mod run;
mod scheduling;
mod service;
mod texts;
mod third_party;
#[cfg(feature = "view")]
mod view;
