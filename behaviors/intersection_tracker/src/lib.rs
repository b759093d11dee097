//! Finds the two vertical edges where the walls of a corridor end, tracks them and steers between them.
//!
//! Kweon et al. (1991), sections 3.5 and 4.

pub mod pair;
