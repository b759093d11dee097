//! `yamabico list`: behaviours and drivers.

use std::process::ExitCode;

use crate::output::{DONE, Print, exit};

/// Lists what this binary brings along.
pub fn list(_: Print) -> ExitCode {
    exit(DONE)
}
