//! The terminal while its keys drive a robot; it is restored in any case.

use std::io::{Write, stdout};

use crossterm::cursor::MoveToColumn;
use crossterm::event::{KeyboardEnhancementFlags, PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags};
use crossterm::queue;
use crossterm::style::Print;
use crossterm::terminal::{
    Clear, ClearType, disable_raw_mode, enable_raw_mode, size, supports_keyboard_enhancement,
};

use crate::output::say;

/// A terminal in raw mode. Dropping it restores the terminal, also when a panic unwinds.
pub struct Screen {
    reports_releases: bool,
}

impl Screen {
    /// Switches the terminal to raw mode and prints a line of help.
    ///
    /// # Errors
    /// Standard input is not a terminal, or the terminal was closed.
    pub fn open(help: &str) -> std::io::Result<Screen> {
        say(help);
        enable_raw_mode()?;
        let mut screen = Screen { reports_releases: false };
        if supports_keyboard_enhancement().unwrap_or(false) {
            let flags = KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
            queue!(stdout(), PushKeyboardEnhancementFlags(flags))?;
            screen.reports_releases = true;
        }
        stdout().flush()?;
        Ok(screen)
    }

    /// Replaces the status line by `line`, cut to the width of the terminal.
    ///
    /// # Errors
    /// The terminal was closed.
    pub fn show(&mut self, line: &str) -> std::io::Result<()> {
        let columns = size().ok().map(|(columns, _)| usize::from(columns)).filter(|columns| *columns > 0);
        let width = columns.unwrap_or(80) - 1;
        let shown: String = line.chars().take(width).collect();
        queue!(stdout(), MoveToColumn(0), Clear(ClearType::CurrentLine), Print(shown))?;
        stdout().flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if self.reports_releases {
            let _ = queue!(stdout(), PopKeyboardEnhancementFlags);
        }
        let _ = disable_raw_mode();
        let _ = writeln!(stdout());
    }
}
