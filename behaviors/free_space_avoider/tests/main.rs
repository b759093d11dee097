//! The integration tests of this crate, one module a subject.

mod allocations;
mod inputs;
mod isodata_vectors;
mod polar_allocations;
mod polar_inputs;
mod polar_vectors;
mod vectors;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
