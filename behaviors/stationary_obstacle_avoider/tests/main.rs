//! The integration tests of this crate, one module a subject.

mod allocations;
mod corridor;
mod inputs;
mod lanes;
mod release;
mod rig;
mod vectors;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
