//! Images and maps of a simulated world.

mod buildings;
mod floor_training;
mod map;
mod mirrors;
mod view;

use std::path::Path;

use clap::Subcommand;
use yamabico_sim::World;

use crate::images::Output;
use crate::report::Report;

/// Kinds of output.
#[derive(Subcommand)]
pub enum Command {
    View(view::Arguments),
    Mirrors(mirrors::Arguments),
    FloorTraining(floor_training::Arguments),
    Map(map::Arguments),
    Buildings(buildings::Arguments),
}

impl Command {
    /// Renders; `out` receives the images.
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        match self {
            Self::View(arguments) => arguments.run(out),
            Self::Mirrors(arguments) => arguments.run(out),
            Self::FloorTraining(arguments) => arguments.run(out),
            Self::Map(arguments) => arguments.run(out),
            Self::Buildings(arguments) => arguments.run(out),
        }
    }
}

fn read_world(path: &Path) -> Result<World, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    World::from_toml(&text).map_err(|error| format!("{}: {error}", path.display()))
}

fn require_output(out: &Output) -> Result<(), String> {
    if out.is_on() { Ok(()) } else { Err("needs a folder for the images: `--out DIR`".to_owned()) }
}
