//! `yamabico import`: a task from the configuration of another program.

use std::path::PathBuf;

use clap::Args;
use yamabico_ros2::twist_mux;

use crate::output::{CommandResult, DONE, Failure, Print};

/// Arguments of `import`.
#[derive(Args)]
pub struct Arguments {
    /// Configuration file of twist_mux, such as twist_mux.yaml.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Robot file to name in the task.
    #[arg(long, value_name = "FILE", default_value = "robots/turtlebot4-ros2.toml")]
    robot: String,
}

/// Prints the task.
pub fn import(arguments: &Arguments, print: Print) -> CommandResult {
    let refused = |error: String| Failure::usage(format!("{}: {error}", arguments.file.display()));
    let text = twist_mux::task(&arguments.file, &arguments.robot).map_err(refused)?;
    print.show(&text, |text| text.trim_end().to_owned());
    Ok(DONE)
}
