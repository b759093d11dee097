//! The integration tests of this crate, one module a subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod allocations;
mod approach;
mod inputs;
mod rig;
mod template_vectors;
mod vectors;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
