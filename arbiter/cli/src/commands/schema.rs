//! `yamabico schema`: the JSON Schema of task and robot files.

use std::process::ExitCode;


use crate::output::{DONE, exit};

/// Prints the schema.
pub fn schema() -> ExitCode {
    
    exit(DONE)
}
