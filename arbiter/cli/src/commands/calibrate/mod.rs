//! `yamabico calibrate`: lens, mount and clock of a robot's camera.

mod board;
mod clock;
mod intrinsics;
mod mount;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use yamabico::plugins::plugins;
use yamabico_learning::calibration::Measured;
use yamabico_learning::calibration::robot_camera::{Findings, RobotCamera};
use yamabico_vision::calibration::Board;

use crate::output::{CommandResult, Failure, Print};

/// The quantity to calibrate.
#[derive(Subcommand)]
pub enum Calibrate {
    /// Write the checkerboard as a PDF to print at true scale.
    Board(board::Arguments),
    /// Calibrate the lens, from pictures of the printed checkerboard.
    Intrinsics(intrinsics::Arguments),
    /// Calibrate height, tilt, roll and pan, from a drive along a corridor or from the board on the floor.
    Mount(mount::Arguments),
    /// Calibrate the latency of the camera, from a recording of turns with odometry.
    Clock(clock::Arguments),
}

/// Calibrates, and prints what was measured.
pub fn calibrate(calibrate: &Calibrate, print: Print) -> CommandResult {
    match calibrate {
        Calibrate::Board(arguments) => board::write(arguments, print),
        Calibrate::Intrinsics(arguments) => intrinsics::calibrate(arguments, print),
        Calibrate::Mount(arguments) => mount::calibrate(arguments, print),
        Calibrate::Clock(arguments) => clock::calibrate(arguments, print),
    }
}

/// The printed board.
#[derive(Args)]
struct BoardArguments {
    /// Inner corners of the board, those where four squares meet: columns x rows.
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "9x6")]
    corners: String,
    /// Side of a square, mm, measured on the printed page.
    #[arg(long, value_name = "MM", default_value_t = 25.0, allow_negative_numbers = true)]
    square_mm: f64,
}

impl BoardArguments {
    fn board(&self) -> Result<Board, Failure> {
        Board::new(&self.corners, 1e-3 * self.square_mm).map_err(Failure::usage)
    }
}

/// The camera, in a robot file.
#[derive(Args)]
struct CameraArguments {
    /// Robot file with the camera.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Name of the camera in the robot file; by default its only one.
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,
    /// Write the result into this robot file, whose comments and other keys stay; without it, the result is printed to be pasted.
    #[arg(long, value_name = "ROBOT.toml")]
    write: Option<PathBuf>,
}

impl CameraArguments {
    /// Reads the camera of the robot file, if one is named.
    fn camera(&self) -> Result<Option<RobotCamera>, Failure> {
        let file = self.robot.as_ref().or(self.write.as_ref());
        let read = |file: &PathBuf| RobotCamera::read(file, self.sensor.as_deref(), &plugins());
        Ok(file.map(read).transpose()?)
    }

    /// Reads the camera of the robot file, or that in the robot files attached to a recording.
    fn camera_of(&self, recording: &Path) -> Result<RobotCamera, Failure> {
        if let Some(camera) = self.camera()? {
            return Ok(camera);
        }
        let attached = RobotCamera::of_recording(recording, self.sensor.as_deref(), &plugins())?;
        attached.ok_or_else(|| {
            Failure::usage(format!(
                "{} has no robot file with this camera: name one with --robot, and the camera with --sensor",
                recording.display()
            ))
        })
    }

    /// Writes the findings where that is wanted; returns what is to be said about it, for people.
    fn finish(&self, camera: &RobotCamera, findings: &Findings) -> Result<Written, Failure> {
        let toml = camera.toml(findings);
        if let Some(file) = &self.write {
            camera.write(file, findings)?;
        }
        Ok(Written { file: self.write.clone(), toml })
    }
}

/// Result for a robot file.
#[derive(serde::Serialize)]
struct Written {
    /// Robot file that was changed.
    file: Option<PathBuf>,
    /// Tables for a robot file.
    toml: String,
}

impl Written {
    fn text(&self) -> String {
        match &self.file {
            Some(file) => format!("written to {}:\n{}", file.display(), self.toml),
            None => format!("for the robot file (or --write ROBOT.toml):\n{}", self.toml),
        }
    }
}

/// Number with its standard deviation.
fn with_sigma(number: &Measured, decimals: usize) -> String {
    // Adding zero turns a negative zero into a positive one.
    let value = format!("{:.decimals$}", number.value + 0.0);
    match number.sigma {
        Some(sigma) => format!("{value} ± {sigma:.decimals$}"),
        None => value,
    }
}
