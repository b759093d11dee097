//! Calibration of a robot's camera: its lens, its mount, and the offset of its clock from that of odometry.
//!
//! | Module | Measures | From |
//! |---|---|---|
//! | [`board_page`] | - | writes the checkerboard as a page to print |
//! | [`lens`] | intrinsics and distortion | pictures of the board |
//! | [`mount`] | height, tilt, roll, pan, row of the principal point | pictures or a recording of a drive along a corridor |
//! | [`floor_board`] | height, tilt, roll, pan | pictures of the board on the floor |
//! | [`clock`] | `latency_ms` | a recording of turns with odometry |
//!
//! [`robot_camera`] reads the camera from a robot file and writes results into it, without touching its comments.

pub mod board_page;
mod camera_height;
mod camera_keys;
pub mod clock;
pub mod floor_board;
pub mod lens;
pub mod mount;
mod overlay;
pub mod pictures;
mod recorded_drive;
mod refusal;
pub mod robot_camera;

/// Number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Value.
    pub value: f64,
    /// Standard deviation; `None` if it is not known.
    pub sigma: Option<f64>,
}

impl Measured {
    fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma: Some(sigma).filter(|sigma| sigma.is_finite()) }
    }

    fn degrees(value_rad: f64, sigma_rad: f64) -> Self {
        Self::new(value_rad.to_degrees(), sigma_rad.to_degrees())
    }
}
