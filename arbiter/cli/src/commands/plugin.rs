//! `yamabico plugin`: a plugin in a process of its own, started by the supervisor of a running robot.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use yamabico::plugins::plugins;
use yamabico_host::Scheduling;
use yamabico_host::process::{Guardian, OnDeath, serve};

use crate::output::{DEVICE_FAILED, fail};

/// What `plugin` is told; the rest is on standard input.
#[derive(Args)]
pub struct Arguments {
    /// Its name in the task or robot file: for whoever lists processes.
    name: String,
    /// The process that it does not outlive.
    #[arg(long, value_name = "PID")]
    guardian: u32,
    /// What the guardian's death is for it.
    #[arg(long, value_enum)]
    on_death: Death,
    /// What is asked of the system's scheduler.
    #[arg(long, value_name = "fifo=N,nice=N,processors=N", default_value = "")]
    scheduling: Scheduling,
    /// The program that it becomes, and its arguments; without one, a plugin of this program.
    #[arg(last = true)]
    exec: Vec<OsString>,
}

/// What the guardian's death is for a plugin.
#[derive(Clone, Copy, ValueEnum)]
enum Death {
    /// Its own at once.
    Die,
    /// It brakes first.
    Brake,
}

/// Becomes the plugin.
pub fn plugin(arguments: &Arguments) -> ExitCode {
    let on_death = match arguments.on_death {
        Death::Die => OnDeath::Die,
        Death::Brake => OnDeath::Brake,
    };
    match (Guardian { pid: arguments.guardian, on_death }).follow() {
        Ok(true) => {}
        Ok(false) => return fail("the supervisor is gone", DEVICE_FAILED),
        Err(error) => return fail(&format!("cannot follow the supervisor: {error}"), DEVICE_FAILED),
    }
    for refused in arguments.scheduling.apply() {
        tracing::warn!("`{}` runs on although {refused}", arguments.name);
    }
    match arguments.exec.split_first() {
        None => serve(&plugins()),
        Some((program, rest)) => {
            // Returns only where it fails.
            let error = std::process::Command::new(program).args(rest).exec();
            fail(&format!("cannot start {}: {error}", program.display()), DEVICE_FAILED)
        }
    }
}
