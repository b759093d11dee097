//! Localization by the edges of a wire-frame map in the images of a pinhole camera.
//!
//! Ohya, Kosaka & Kak (1998) \[1\], sections 3.1 and 3.2: edges expected in view are matched with the segments of the
//! image, and each pair updates the pose. Differs from \[1\]: pairs are chosen jointly, and the image is matched a
//! second time after a large correction. If the vanishing point contradicts the odometry, the wheels have slipped, and
//! the image is matched from the observed heading.

pub mod association;
pub mod axis_heading;
pub mod consensus;
mod finder;
pub mod fixer;
pub mod matching;
pub mod overlay;
pub mod projected_line;
pub mod recovery;
pub mod relocalize;

pub use finder::WireFrameFinder;
