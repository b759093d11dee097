//! `yamabico list`: the behaviors and drivers of this program.

use yamabico::plugins::plugins;
use yamabico_host::config;

use crate::output::{CommandResult, DONE, Print, table};

/// Lists behaviors, drivers, sensors and drives.
pub fn list(print: Print) -> CommandResult {
    print.show(&config::list(&plugins()), |listing| {
        let mut table = table(&["name", "kind", "summary"], 0..0);
        for listed in listing.behaviors.iter().chain(&listing.devices) {
            table.add_row([listed.name.as_str(), listed.what, listed.summary.as_str()]);
        }
        table.to_string()
    });
    Ok(DONE)
}
