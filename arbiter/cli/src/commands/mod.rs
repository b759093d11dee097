//! The commands.

pub mod check;
pub mod describe;
pub mod goto;
pub mod graph;
pub mod learn;
mod learn_floor;
mod learn_map;
mod learn_plot;
pub mod list;
mod map_plot;
pub mod new;
pub mod plugin;
pub mod run;
mod run_table;
pub mod schema;
mod verify_surfaces;
mod whereabouts;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use yamabico_host::config::{Overrides, Task, load};
use yamabico_parameters::Problems;

use crate::output::Print;
use yamabico::plugins::plugins;

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Run a task until its goal is reached, its time is over or its sensors have ended.
    Run(run::Arguments),
    /// Send a running robot to a goal and wait until it is there.
    Goto(goto::Arguments),
    /// Learn what a building or its floor looks like.
    #[command(subcommand)]
    Learn(learn::Learn),
    /// Tell everything that is wrong with a task, without opening a device.
    Check(TaskArguments),
    /// List behaviors and drivers.
    List,
    /// Describe a behavior, a driver, a sensor or a drive: its inputs, outputs and parameters.
    Describe(describe::Arguments),
    /// Print the JSON Schemas of task, robot and world files, for editors.
    Schema,
    /// Draw a task: sensors, behaviors, wires, drive.
    Graph(graph::Arguments),
    /// Write a crate to begin a plugin with.
    #[command(subcommand)]
    New(new::New),
    /// Be a plugin of a running robot.
    #[command(hide = true)]
    Plugin(plugin::Arguments),
}

/// A task and what is changed in it.
#[derive(Args)]
pub struct TaskArguments {
    /// The task file.
    pub file: PathBuf,
    /// Use this robot file instead of the one that the task names.
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// Change a key: `behaviors.wall-follower.speed_mps=0.2`, or `robot.sensors.front.intrinsics.fov_deg=70` in the robot file.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl TaskArguments {
    /// What `--robot` and `--set` say.
    pub fn overrides(&self) -> Overrides {
        Overrides { robot: self.robot.clone(), set: self.set.clone() }
    }

    /// The checked task.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn load(&self) -> Result<Task, Problems> {
        load(&self.file, &self.overrides(), &plugins())
    }

    /// The checked task; where there is none, what is wrong is printed.
    pub fn load_or_tell(&self, print: Print) -> Option<Task> {
        self.load().map_err(|problems| print.problems(&problems)).ok()
    }
}
