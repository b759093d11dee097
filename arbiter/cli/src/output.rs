//! Text for people, JSON for programs.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, ContentArrangement, Table};
use serde::Serialize;
use yamabico_parameters::{Problems, Style};

/// Arrived, or done.
pub const DONE: u8 = 0;
/// The robot did not arrive.
pub const NOT_ARRIVED: u8 = 1;
/// The configuration or the arguments are wrong.
pub const BAD_CONFIGURATION: u8 = 2;
/// A device failed.
pub const DEVICE_FAILED: u8 = 3;

/// How results are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Print {
    /// For people.
    Text,
    /// For programs.
    Json,
}

impl Print {
    /// Prints `value` as JSON or as `text` makes of it.
    pub fn show<T: Serialize>(self, value: &T, text: impl FnOnce(&T) -> String) {
        let text = match self {
            Print::Text => text(value),
            Print::Json => serde_json::to_string_pretty(value).unwrap_or_else(|error| error.to_string()),
        };
        // A reader that has gone away, as `head` does, wants no more.
        let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
    }

    /// Tells what is wrong with a configuration.
    pub fn problems(self, problems: &Problems) {
        match self {
            Print::Json => self.show(&problems.entries(), |_| String::new()),
            Print::Text => {
                let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
                eprint!("{}", problems.render(if color { Style::Colored } else { Style::Plain }));
                let plural = if problems.len() == 1 { "mistake" } else { "mistakes" };
                eprintln!("{} {plural}; nothing was opened", problems.len());
            }
        }
    }
}

/// An exit code.
pub fn exit(code: u8) -> ExitCode {
    ExitCode::from(code)
}

/// Tells on standard error what went wrong, for an exit with this code.
pub fn fail(problem: &str, code: u8) -> ExitCode {
    eprintln!("error: {problem}");
    exit(code)
}

/// A table with this head; columns named in `numbers` are aligned to the right.
pub fn table(head: &[&str], numbers: std::ops::Range<usize>) -> Table {
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(head);
    for column in numbers {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}
