//! `yamabico graph`: a task as a picture.

use std::process::ExitCode;

use clap::{Args, ValueEnum};
use yamabico_host::config;

use super::TaskArguments;
use crate::output::{BAD_CONFIGURATION, DONE, Print, exit};

/// What `graph` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// In which language.
    #[arg(long, value_enum, default_value_t = Language::Mermaid)]
    format: Language,
}

#[derive(Clone, Copy, ValueEnum)]
enum Language {
    /// For Markdown.
    Mermaid,
    /// For Graphviz.
    Dot,
}

/// Draws the task.
pub fn graph(arguments: &Arguments, print: Print) -> ExitCode {
    let Some(task) = arguments.task.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    print.show(&config::graph(&task), |graph| match arguments.format {
        Language::Mermaid => graph.mermaid(),
        Language::Dot => graph.dot(),
    });
    exit(DONE)
}
