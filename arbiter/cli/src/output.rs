//! Results and errors of commands: text for people, JSON for programs.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, ContentArrangement, Table};
use serde::Serialize;
use yamabico_parameters::{Problems, Style};
use yamabico_runtime::client::ClientError;

/// Exit code: the goal was reached, or the command is done.
pub const DONE: ExitCode = ExitCode::SUCCESS;
/// Exit code: the goal was not reached, the run was interrupted, or the robot did not answer.
pub const NOT_DONE: ExitCode = ExitCode::FAILURE;
/// Exit code: the configuration or the arguments are wrong.
const BAD_CONFIGURATION: u8 = 2;
/// Exit code: a device or a file failed.
const DEVICE_FAILED: u8 = 3;

/// Exit code of a command that did what it could, or a failure to report.
pub type CommandResult = Result<ExitCode, Failure>;

/// A command that failed: an exit code and the message for standard error.
#[derive(Debug)]
pub enum Failure {
    /// A message and the exit code.
    Message(String, ExitCode),
    /// The errors of a configuration that was to be run.
    Configuration(Problems),
    /// The errors of a configuration that was to be checked.
    Checked(Problems),
}

impl Failure {
    /// The configuration or the arguments are wrong, or no such robot is running.
    pub fn usage(problem: impl Display) -> Failure {
        Failure::Message(problem.to_string(), ExitCode::from(BAD_CONFIGURATION))
    }

    /// The robot did not answer, or did not do what was requested.
    pub fn not_done(problem: impl Display) -> Failure {
        Failure::Message(problem.to_string(), NOT_DONE)
    }

    /// A device or a file failed.
    pub fn device(problem: impl Display) -> Failure {
        Failure::Message(problem.to_string(), ExitCode::from(DEVICE_FAILED))
    }

    /// Prints the failure; returns its exit code.
    pub fn report(&self, print: Print) -> ExitCode {
        match self {
            Failure::Message(problem, code) => {
                // Errors with an excerpt of their file begin with a title of their own.
                let title = if problem.starts_with("Error: ") { "" } else { "error: " };
                complain(&format!("{title}{}", printable(problem)));
                *code
            }
            Failure::Configuration(problems) => {
                print.problems(problems, "; nothing was opened");
                ExitCode::from(BAD_CONFIGURATION)
            }
            Failure::Checked(problems) => {
                print.problems(problems, "");
                ExitCode::from(BAD_CONFIGURATION)
            }
        }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Failure {
        if error.is_wrong_request() { Failure::usage(error) } else { Failure::not_done(error) }
    }
}

impl From<Problems> for Failure {
    fn from(problems: Problems) -> Failure {
        Failure::Configuration(problems)
    }
}

/// Reports arguments that cannot be parsed, or prints the requested help; returns the exit code.
pub fn usage(error: &clap::Error) -> ExitCode {
    let text = error.render();
    let code = u8::try_from(error.exit_code()).unwrap_or(BAD_CONFIGURATION);
    // Arguments are quoted in the text: as they are, they could control the terminal.
    match printable(&text.to_string()) {
        Cow::Borrowed(_) => drop(error.print()),
        Cow::Owned(escaped) => complain(escaped.trim_end()),
    }
    ExitCode::from(code)
}

/// Output format of results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Print {
    /// Text and tables, for people.
    Text,
    /// JSON, for programs.
    Json,
}

impl Print {
    /// Prints `value` as JSON, or as the text that `text` makes of it.
    pub fn show<T: Serialize>(self, value: &T, text: impl FnOnce(&T) -> String) {
        let text = match self {
            Print::Text => text(value),
            Print::Json => serde_json::to_string_pretty(value).unwrap_or_else(|error| error.to_string()),
        };
        say(&printable(text.trim_end()));
    }

    fn problems(self, problems: &Problems, consequence: &str) {
        match self {
            Print::Json => self.show(&problems.entries(), |_| String::new()),
            Print::Text => {
                let text = problems.render(if use_color() { Style::Colored } else { Style::Plain });
                let errors = if problems.len() == 1 { "error" } else { "errors" };
                complain(&format!("{text}{} {errors}{consequence}", problems.len()));
            }
        }
    }
}

/// Prints a line on standard output. If the reader of a pipe has closed it, as `head` does, the line is lost.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints a line on standard error; likewise.
pub fn complain(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Returns true if standard error is a terminal and the user allows colors.
pub fn use_color() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Escapes control characters other than line feed and tab, which could control the terminal.
pub fn printable(text: &str) -> Cow<'_, str> {
    let controls = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(controls) {
        return Cow::Borrowed(text);
    }
    let escape = |c: char| if controls(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(escape).collect())
}

/// A table with this header; the columns in `numbers` are aligned to the right.
pub fn table(header: &[&str], numbers: std::ops::Range<usize>) -> Table {
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    for column in numbers {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_text_is_not() {
        assert_eq!(printable("no key `\u{7}x\u{1b}[2J`"), "no key `\\u{7}x\\u{1b}[2J`");
        assert!(matches!(printable("a table\n│ 5 µm ┆\tü │"), Cow::Borrowed(_)));
    }
}
