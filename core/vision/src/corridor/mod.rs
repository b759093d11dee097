//! A straight corridor seen by a camera that looks along it: heading, floor lines, distances of the walls.
//!
//! Kweon et al. (1991), worked out for any heading, tilt and roll. Corridor frame: x along the corridor, y left, z up.

pub mod floor_lines;
pub mod heading;
pub mod sight;
pub mod skirting;
pub mod wall_distance;
