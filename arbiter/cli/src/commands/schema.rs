//! `yamabico schema`: the JSON Schemas of task, robot and world files.

use std::process::ExitCode;

use yamabico::plugins::PLUGINS;
use yamabico_core::config;

use crate::output::{DONE, Print, exit};

/// Prints the schema.
pub fn schema() -> ExitCode {
    Print::Json.show(&config::schema(&PLUGINS), |_| String::new());
    exit(DONE)
}
