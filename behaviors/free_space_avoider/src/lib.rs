//! Drives where the floor is free, without a map, by one picture at a time.

pub mod navel_grid;
