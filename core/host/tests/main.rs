//! Integration tests of this crate, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bus_allocations;
mod bus_channels;
mod bus_processes;
mod bus_users;
mod config;
#[path = "../examples/python_messages/generate.rs"]
mod generate;
mod python_messages;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
