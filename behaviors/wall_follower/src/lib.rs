//! Follows a corridor by the vanishing point and the floor lines of its walls.

pub mod centring;
pub mod heading;
pub mod stereo;
pub mod wall_distance;
