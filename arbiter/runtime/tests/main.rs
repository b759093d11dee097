//! Integration tests, one module for each subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod client;
mod hostile;
mod hostile_recordings;
mod live;
mod lockstep;
mod recording;
mod stand_ins;
