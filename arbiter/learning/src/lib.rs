//! Learns properties of a building for the behaviors, from a drive, a recording or marked images.
//!
//! | Module | Learns | From | For |
//! |---|---|---|---|
//! | [`thresholds`] | edge thresholds of an empty building, by location | a drive with a map | `stationary-obstacle-avoider` |
//! | [`edge_map`] | a map of vertical edges, and which surfaces between them are solid | a drive with a mirror camera, or a recording | `map-localizer`, method azimuth |
//! | [`floor`] | the colors of a floor | images with masks | `free-space-avoider`; `map-localizer`, method floor-outline |
//!
//! [`calibration`] measures the robot itself: the lens, the mount and the clock of its camera.
//!
//! Each module in the table has one function `learn`, which writes a TOML file and returns what was learned.
//!
//! ```no_run
//! use std::path::Path;
//! use yamabico_learning::floor::{self, Form};
//!
//! let learned = floor::learn(Path::new("images"), Path::new("floor.toml"), Form::Table)?;
//! for image in &learned.images {
//!     println!("{}: {:.1} % of the floor found", image.name, 100.0 * image.recall);
//! }
//! # Ok::<(), yamabico_learning::LearningError>(())
//! ```

pub mod calibration;
pub mod edge_map;
mod error;
pub mod floor;
mod robot_track;
mod task_source;
pub mod thresholds;

pub use error::LearningError;
pub use task_source::TaskSource;
