//! The terminal while its keys drive a robot: given back as it was, whatever happens.

use std::io::{Write, stdout};

use crossterm::cursor::MoveToColumn;
use crossterm::event::{KeyboardEnhancementFlags, PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags};
use crossterm::queue;
use crossterm::style::Print;
use crossterm::terminal::{
    Clear, ClearType, disable_raw_mode, enable_raw_mode, size, supports_keyboard_enhancement,
};

/// A terminal that hands over every key. Dropping it gives the terminal back, also when a panic unwinds.
pub struct Screen {
    tells_releases: bool,
}

impl Screen {
    /// Takes the terminal, and writes a line of help.
    ///
    /// # Errors
    /// It is no terminal, or is gone.
    pub fn open(help: &str) -> std::io::Result<Screen> {
        println!("{help}");
        enable_raw_mode()?;
        let mut screen = Screen { tells_releases: false };
        if supports_keyboard_enhancement().unwrap_or(false) {
            let flags = KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
            queue!(stdout(), PushKeyboardEnhancementFlags(flags))?;
            screen.tells_releases = true;
        }
        stdout().flush()?;
        Ok(screen)
    }

    /// Writes `line` over the one before, as much of it as there is room for.
    ///
    /// # Errors
    /// The terminal is gone.
    pub fn show(&mut self, line: &str) -> std::io::Result<()> {
        let columns = size().ok().map(|(columns, _)| usize::from(columns)).filter(|columns| *columns > 0);
        let room = columns.unwrap_or(80) - 1;
        let shown: String = line.chars().take(room).collect();
        queue!(stdout(), MoveToColumn(0), Clear(ClearType::CurrentLine), Print(shown))?;
        stdout().flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if self.tells_releases {
            let _ = queue!(stdout(), PopKeyboardEnhancementFlags);
        }
        let _ = disable_raw_mode();
        let _ = writeln!(stdout());
    }
}
