//! The command line of Yamabico: one small file a command.

mod commands;
mod live;
mod output;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use commands::{Command, check, describe, goto, graph, learn, list, new, plugin, run, schema};

/// Drives a robot with independent behaviors, and can say why.
#[derive(Parser)]
#[command(name = "yamabico", version, propagate_version = true, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Either,
    /// Print tables as JSON.
    #[arg(long, global = true)]
    json: bool,
}

/// A command that takes a task, or one for a robot that runs.
#[derive(Subcommand)]
enum Either {
    #[command(flatten)]
    Command(Command),
    #[command(flatten)]
    Live(live::Command),
}

const EXIT_CODES: &str = "Exit codes: 0 arrived or done, 1 not arrived or interrupted, 2 bad configuration or usage, 3 a device failed.";

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_env("YAMABICO_LOG").unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).without_time().init();
    let Arguments { command, json } = Arguments::parse();
    let print = if json { output::Print::Json } else { output::Print::Text };
    let command = match command {
        Either::Live(command) => return command.run(print),
        Either::Command(command) => command,
    };
    match command {
        Command::Run(arguments) => run::run(&arguments, print),
        Command::Goto(arguments) => goto::goto(&arguments, print),
        Command::Learn(what) => learn::learn(&what, print),
        Command::Check(arguments) => check::check(&arguments, print),
        Command::List => list::list(print),
        Command::Describe(arguments) => describe::describe(&arguments, print),
        Command::Schema => schema::schema(),
        Command::Graph(arguments) => graph::graph(&arguments, print),
        Command::New(what) => new::new(&what, print),
        Command::Plugin(arguments) => plugin::plugin(&arguments),
    }
}
