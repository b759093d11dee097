//! Integration tests of this crate, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod allocations;
mod inputs;
mod mirror_inputs;
mod obstacles;
mod odometry_only;
mod omni_vectors;
mod pose_allocations;
mod rendered_azimuths;
mod rig;
mod slip;
mod slip_vectors;
mod vectors;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
