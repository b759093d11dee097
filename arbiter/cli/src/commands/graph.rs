//! `yamabico graph`: a task as a diagram.

use clap::{Args, ValueEnum};
use yamabico_host::config;

use crate::output::{CommandResult, DONE, Print};
use crate::task_arguments::TaskArguments;

/// Arguments of `graph`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Language of the diagram.
    #[arg(long, value_enum, default_value_t = Language::Mermaid)]
    format: Language,
}

#[derive(Clone, Copy, ValueEnum)]
enum Language {
    /// Mermaid, for Markdown.
    Mermaid,
    /// DOT, for Graphviz.
    Dot,
}

/// Draws the task.
pub fn graph(arguments: &Arguments, print: Print) -> CommandResult {
    let task = arguments.task.load()?;
    print.show(&config::graph(&task), |graph| match arguments.format {
        Language::Mermaid => graph.mermaid(),
        Language::Dot => graph.dot(),
    });
    Ok(DONE)
}
