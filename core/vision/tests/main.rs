//! Integration tests of this crate, one module per subject.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod azimuth_allocations;
mod azimuth_vectors;
mod corridor_photographs;
mod corridor_vectors;
mod floor_appearance;
mod map_vectors;
mod mask_vectors;
mod plane_motion_pictures;
mod plane_motion_vectors;
mod rendered_floor;
mod vision_allocations;
mod vision_segments;
mod vision_vanishing_point;
mod vision_vectors;
mod vote_density;

use yamabico_core::testing::CountingAllocator;

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;
