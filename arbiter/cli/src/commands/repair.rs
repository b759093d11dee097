//! `yamabico repair`: an index and an end for a recording whose run was killed.

use std::path::PathBuf;

use clap::Args;
use yamabico_runtime::record::{RepairError, Repaired, repair as repair_file};

use crate::output::{CommandResult, DONE, Failure, Print};

/// Arguments of `repair`.
#[derive(Args)]
pub struct Arguments {
    /// Recording.
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
}

/// Repairs the recording.
pub fn repair(arguments: &Arguments, print: Print) -> CommandResult {
    let repaired = repair_file(&arguments.file).map_err(|error| match error {
        RepairError::Read(_) => Failure::usage(error),
        _ => Failure::device(error),
    })?;
    print.show(&repaired, |repaired| {
        let Repaired { messages, seconds, broken_off, kept } = repaired;
        let file = arguments.file.display();
        match (broken_off, kept) {
            (Some(cause), Some(kept)) => format!(
                "{file}: {messages} messages over {seconds:.1} s, with an index now; it broke off: {cause}\n\
                 the file as it was: {}",
                kept.display()
            ),
            _ => format!("{file}: {messages} messages over {seconds:.1} s; it is whole, nothing was changed"),
        }
    });
    Ok(DONE)
}
