//! `yamabico learn`: thresholds, maps and floor colors of a building.

mod floor;
mod map;
mod thresholds;

use clap::{Args, Subcommand};
use yamabico::plugins::plugins;
use yamabico_host::config::Task;
use yamabico_learning::{LearningError, TaskSource};
use yamabico_runtime::execution::Progress;
use yamabico_runtime::supervisor::Program;

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, Failure, Print, complain, printable};
use crate::progress::RunProgress;
use crate::task_arguments::TaskArguments;

/// The kind of thing to learn.
#[derive(Subcommand)]
pub enum Learn {
    /// Learn the thresholds of the stationary-obstacle-avoider, from a drive through the empty building.
    Thresholds(thresholds::Arguments),
    /// Learn a map of vertical edges for the map-localizer, from a drive with a mirror camera.
    Map(map::Arguments),
    /// Learn the colors of a floor for the free-space-avoider, from marked images.
    Floor(floor::Arguments),
}

/// Learns, and prints what was learned.
pub fn learn(learn: &Learn, print: Print) -> CommandResult {
    match learn {
        Learn::Thresholds(arguments) => thresholds::learn(arguments, print),
        Learn::Map(arguments) => map::learn(arguments, print),
        Learn::Floor(arguments) => floor::learn(arguments, print),
    }
}

impl From<LearningError> for Failure {
    fn from(error: LearningError) -> Failure {
        match error {
            LearningError::Configuration(problems) => Failure::Configuration(problems),
            error if error.is_of_a_device() => Failure::device(error),
            error => Failure::usage(error),
        }
    }
}

/// Arguments on the way in which the task is driven.
#[derive(Args)]
struct DriveArguments {
    /// Drives in real time, each plugin in its own process, as a world outside or a real robot needs it. Ctrl-C stops the robot
    /// and ends the drive; what was learned until then is written.
    #[arg(long)]
    live: bool,
    /// Random seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl DriveArguments {
    fn source(&self, task: &TaskArguments) -> Result<TaskSource, Failure> {
        Ok(TaskSource {
            file: task.file.clone(),
            overrides: task.overrides(),
            plugins: plugins(),
            seed: self.seed,
            live: self.live.then(Program::this),
            interrupt: interrupt_flag()?,
        })
    }
}

fn warn(warnings: &[String]) {
    for warning in warnings {
        complain(&format!("warning: {}", printable(warning)));
    }
}

/// Returns a function that shows the progress of each drive.
fn show_progress(print: Print) -> impl FnMut(&Task, Progress) {
    let mut bar: Option<RunProgress> = None;
    move |task, progress| {
        bar.get_or_insert_with(|| RunProgress::new(task, "learning in ", print)).show(task, progress);
    }
}
