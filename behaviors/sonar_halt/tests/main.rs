//! Integration tests of this crate, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod allocations;
mod halting;
mod laser_and_bumper;
mod swept_path;
mod vectors;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
