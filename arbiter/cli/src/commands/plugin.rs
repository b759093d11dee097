//! `yamabico plugin`: one plugin in its own process, started by the supervisor of a running robot.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;

use clap::{Args, ValueEnum};
use yamabico::plugins::plugins;
use yamabico_host::Scheduling;
use yamabico_host::process::{OnParentDeath, ParentProcess, serve};

use crate::output::{CommandResult, Failure};

/// Arguments of `plugin`; the launch configuration is read from standard input.
#[derive(Args)]
pub struct Arguments {
    /// Name in the task or robot file, for process listings.
    name: String,
    /// Process id of the supervisor.
    #[arg(long, value_name = "PID")]
    guardian: u32,
    /// Reaction to the death of the supervisor.
    #[arg(long, value_enum)]
    on_death: Death,
    /// Settings of the system's scheduler.
    #[arg(long, value_name = "fifo=N,nice=N,processors=N", default_value = "")]
    scheduling: Scheduling,
    /// External program to become, with its arguments; by default a plugin of this program.
    #[arg(last = true)]
    exec: Vec<OsString>,
}

/// Reaction to the death of the supervisor.
#[derive(Clone, Copy, ValueEnum)]
enum Death {
    /// Die at once.
    Die,
    /// Brake first.
    Brake,
}

/// Becomes the plugin.
pub fn plugin(arguments: &Arguments) -> CommandResult {
    let on_death = match arguments.on_death {
        Death::Die => OnParentDeath::Die,
        Death::Brake => OnParentDeath::Brake,
    };
    match (ParentProcess { pid: arguments.guardian, on_death }).follow() {
        Ok(true) => {}
        Ok(false) => return Err(Failure::device("the supervisor has ended")),
        Err(error) => return Err(Failure::device(format!("cannot follow the supervisor: {error}"))),
    }
    for refused in arguments.scheduling.apply() {
        tracing::warn!("`{}` runs on although {refused}", arguments.name);
    }
    match arguments.exec.split_first() {
        None => Ok(serve(&plugins())),
        Some((program, rest)) => {
            // Returns only if it fails.
            let error = std::process::Command::new(program).args(rest).exec();
            Err(Failure::device(format!("cannot start {}: {error}", program.display())))
        }
    }
}
