//! The robot's pose from the edges of a wire-frame map, seen by a pinhole camera.
//!
//! Ohya, Kosaka & Kak (1998), sections 3.1 and 3.2: edges that should be in view are matched with the segments of the picture,
//! and each pair moves the pose. Differs from \[1\]: pairs are chosen together, and the picture is matched once more where
//! the pose moved far.

pub mod association;
pub mod consensus;
mod finder;
pub mod fixer;
pub mod matching;
pub mod projected_line;
pub mod relocalize;

pub use finder::WireFrameFinder;
