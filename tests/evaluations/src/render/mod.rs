//! Images and maps of a simulated world.

mod buildings;
mod floor_training;
mod map;
mod mirrors;
mod view;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use yamabico_sim::{Scene, World};

use crate::arguments::At;
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

/// A world at an instant, and the robot in it.
#[derive(Args)]
struct SceneFile {
    /// World file, such as configs/worlds/hallway.toml.
    world: PathBuf,
    #[command(flatten)]
    at: At,
    /// Time since the start, which moves people, s.
    #[arg(long, default_value_t = 0.0)]
    time_s: f64,
}

impl SceneFile {
    /// Reads the world and moves its people.
    fn scene(&self) -> Result<Scene, String> {
        let mut scene = Scene::new(&read_world(&self.world)?, 1).map_err(|error| error.to_string())?;
        scene.set_time(self.time_s).map_err(|error| error.to_string())?;
        Ok(scene)
    }
}

fn read_world(path: &Path) -> Result<World, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    World::from_toml(&text).map_err(|error| format!("{}: {error}", path.display()))
}

pub fn require_output(out: &Output) -> Result<(), String> {
    if out.is_on() { Ok(()) } else { Err("needs a folder for the images: `--out DIR`".to_owned()) }
}
