//! Tests of the view from outside.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod fixture;
mod recordings;
#[cfg(feature = "page")]
mod server;
#[cfg(feature = "terminal")]
mod top;
