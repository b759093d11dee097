//! `yamabico schema`: the JSON Schema of task and robot files.

use std::process::ExitCode;

use yamabico_core::config;

use crate::output::{DONE, exit};
use yamabico::plugins::PLUGINS;

/// Prints the schema.
pub fn schema() -> ExitCode {
    println!("{}", serde_json::to_string_pretty(&config::schema(&PLUGINS)).unwrap_or_else(|error| error.to_string()));
    exit(DONE)
}
