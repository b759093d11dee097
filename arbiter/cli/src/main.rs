//! The command line of Yamabico: one small file for each command.

mod commands;
mod interrupt;
mod output;
mod progress;
mod robot_argument;
mod suggestion;
mod task_arguments;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use tracing_subscriber::EnvFilter;

use output::{Print, use_color};

/// Drives a mobile robot with independent behaviors, and explains every decision.
#[derive(Parser)]
#[command(name = "yamabico", version, propagate_version = true, after_help = AFTER_HELP)]
struct Arguments {
    #[command(subcommand)]
    command: commands::Command,
    /// Print results as JSON.
    #[arg(long, global = true)]
    json: bool,
}

const AFTER_HELP: &str = "\
Exit codes:
  0  the goal was reached, or the command is done
  1  the goal was not reached, the run was interrupted, or the robot did not answer
  2  the configuration or the arguments are wrong; nothing was opened
  3  a device or a file failed

Environment:
  YAMABICO_LOG  log level on standard error: error, warn (default), info, debug or trace
  NO_COLOR      if set, nothing is printed in color";

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_env("YAMABICO_LOG").unwrap_or_else(|_| EnvFilter::new("warn"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(use_color());
    // A closed pipe must not end a run.
    log.with_writer(std::io::stderr).without_time().log_internal_errors(false).init();
    let Arguments { command, json } = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return output::usage(&suggestion::with_suggestion(error, Arguments::command())),
    };
    let print = if json { Print::Json } else { Print::Text };
    command.run(print).unwrap_or_else(|failure| failure.report(print))
}
