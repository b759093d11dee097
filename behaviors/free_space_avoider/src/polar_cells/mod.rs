//! Polar cells: free floor all around by its colour, in the picture of a mirror camera.
//!
//! Sekimori, Usui, Masutani & Miyazaki: floor-coloured pixels, noise closed, counted in cells of rings and directions; how many cells
//! from the innermost outwards are free tells how far each direction is.

pub mod free_cells;

pub use free_cells::FreeCells;
