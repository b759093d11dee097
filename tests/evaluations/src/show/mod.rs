//! Behaviors on one image, with what they detected drawn on it.

mod intersection;
mod mirror_pose;
mod navel_grid;
mod obstacles;
mod overlays;
mod polar_cells;
mod wire_frame;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::arguments::At;
use crate::images::Output;
use crate::report::Report;

/// The behaviors.
#[derive(Subcommand)]
pub enum Command {
    NavelGrid(navel_grid::Arguments),
    PolarCells(polar_cells::Arguments),
    Obstacles(obstacles::Arguments),
    Intersection(intersection::Arguments),
    WireFrame(wire_frame::Arguments),
    MirrorPose(mirror_pose::Arguments),
    Overlays(overlays::Arguments),
}

impl Command {
    /// Runs the behavior; `out` receives the image with the overlay.
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        match self {
            Self::NavelGrid(arguments) => arguments.run(out),
            Self::PolarCells(arguments) => arguments.run(out),
            Self::Obstacles(arguments) => arguments.run(out),
            Self::Intersection(arguments) => arguments.run(out),
            Self::WireFrame(arguments) => arguments.run(out),
            Self::MirrorPose(arguments) => arguments.run(out),
            Self::Overlays(arguments) => arguments.run(out),
        }
    }
}

/// An image file, and the pose from which it was taken or is rendered.
#[derive(Args)]
struct ImageFile {
    /// Image of the robot's camera [default: rendered].
    #[arg(value_name = "IMAGE")]
    image: Option<PathBuf>,
    #[command(flatten)]
    at: At,
}
