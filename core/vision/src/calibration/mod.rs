//! Calibration of a camera: its lens, its mount and its clock.
//!
//! | Quantity | From | Modules |
//! |---|---|---|
//! | Lens | pictures of a printed checkerboard | [`board`], [`checkerboard`], [`lens_calibration`] |
//! | Tilt, roll, row of the principal point | vanishing points and plumb lines in a corridor | [`corridor_sight`], [`horizon_fit`] |
//! | Height | a corridor of known width | [`corridor_height`] |
//! | Height, pan | the floor's motion between pictures with odometry | [`floor_motion`] |
//! | Height, tilt, roll, pan | a board on the floor | [`board_mount`] |
//! | Offset of the camera's clock | turns seen and measured by odometry | [`turn_rate`], [`heading_track`], [`clock_offset`] |
//!
//! Everything here runs offline, and allocates.

pub mod board;
pub mod board_mount;
pub mod checkerboard;
pub mod clock_offset;
mod closed_form;
mod corner_grid;
pub mod corridor_height;
pub mod corridor_sight;
pub mod float_image;
pub mod floor_motion;
mod grid_nodes;
pub mod heading_track;
pub mod homography;
pub mod horizon_fit;
mod horizon_lines;
pub mod lens_adjustment;
pub mod lens_calibration;
mod saddle_points;
pub mod spread;
pub mod turn_rate;
pub mod view_variety;

pub use board::{Board, BoardError};
pub use checkerboard::{FoundBoard, NotFound, find_board};
pub use lens_calibration::{LensCalibration, LensError, calibrate_lens};
