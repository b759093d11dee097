//! `yamabico schema`: the JSON Schemas of task, robot and world files.

use std::process::ExitCode;

use yamabico::plugins::plugins;
use yamabico_host::config;

use crate::output::{DONE, Print, exit};

/// Prints the schema.
pub fn schema() -> ExitCode {
    Print::Json.show(&config::schema(&plugins()), |_| String::new());
    exit(DONE)
}
