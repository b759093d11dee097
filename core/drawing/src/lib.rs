//! Lines, marks and letters drawn into RGB pictures, for people to look at.

mod canvas;
pub mod lettering;

pub use canvas::{Canvas, Color};
