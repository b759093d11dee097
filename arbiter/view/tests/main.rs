//! Tests of the view from outside.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod fixture;
mod recordings;
mod server;
mod top;
