//! Integration tests of this crate, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod blocked_corridor;
mod rungs;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
