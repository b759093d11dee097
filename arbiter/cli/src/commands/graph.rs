//! `yamabico graph`: behaviours and drivers.

use std::process::ExitCode;

use crate::output::{DONE, Print, exit};

/// Lists what this binary brings along.
pub fn graph(_: &Arguments, _: Print) -> ExitCode {
    exit(DONE)
}

/// x
#[derive(clap::Args)]
pub struct Arguments {}
