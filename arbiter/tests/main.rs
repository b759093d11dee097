//! Integration tests, one module for each subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod decide_allocations;
mod decide_properties;
mod decide_rules;
mod why;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
