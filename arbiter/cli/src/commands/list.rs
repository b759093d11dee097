//! `yamabico list`: behaviors and drivers.

use std::process::ExitCode;

use yamabico::plugins::plugins;
use yamabico_host::config;

use crate::output::{DONE, Print, exit, table};

/// Lists what this binary brings along.
pub fn list(print: Print) -> ExitCode {
    print.show(&config::list(&plugins()), |listing| {
        let mut table = table(&["name", "what", "summary"], 0..0);
        for listed in listing.behaviors.iter().chain(&listing.devices) {
            table.add_row([listed.name.as_str(), listed.what, listed.summary.as_str()]);
        }
        table.to_string()
    });
    exit(DONE)
}
