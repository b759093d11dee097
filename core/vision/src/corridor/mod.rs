//! Perception of a straight corridor: robot heading, floor lines and distances of the walls.
//!
//! Kweon et al. (1991), extended to any heading, tilt and roll. Corridor frame: x along the corridor, y left, z up.

pub mod baseboard;
pub mod evidence;
pub mod floor_lines;
pub mod heading;
pub mod observer;
pub mod wall_distance;
