//! The arguments of every command that takes a task.

use std::path::PathBuf;

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_parameters::Problems;

/// A task file and the changes to it.
#[derive(Args)]
pub struct TaskArguments {
    /// Task file.
    pub file: PathBuf,
    /// Robot file to use instead of the one that the task names.
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// Change a key of the task for this run, such as `behaviors.wall-follower.speed_mps=0.2`; after `robot.`, a key of the
    /// robot file, such as `robot.sensors.front.intrinsics.fov_deg=70`. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl TaskArguments {
    /// The changes of `--robot` and `--set`.
    pub fn overrides(&self) -> Overrides {
        Overrides { robot: self.robot.clone(), set: self.set.clone() }
    }

    /// Loads and checks the task.
    ///
    /// # Errors
    /// Every mistake in the task, the robot file and the changes.
    pub fn load(&self) -> Result<Task, Problems> {
        load(&self.file, &self.overrides(), &plugins())
    }
}
