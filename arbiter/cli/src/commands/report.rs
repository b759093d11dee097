//! `yamabico report`: one HTML file on a recording.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use yamabico_runtime::report::write_report;

use crate::output::{CommandResult, DONE, Failure, Print};

/// Arguments of `report`.
#[derive(Args)]
pub struct Arguments {
    /// Recording of a run, also one that ends early.
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Page to write; by default beside the recording, with the extension `html`.
    #[arg(long, value_name = "FILE.html")]
    out: Option<PathBuf>,
}

/// The written page.
#[derive(Serialize)]
struct Written {
    /// File.
    report: PathBuf,
}

/// Writes the report and prints its path.
pub fn report(arguments: &Arguments, print: Print) -> CommandResult {
    let page = arguments.out.clone().unwrap_or_else(|| arguments.recording.with_extension("html"));
    write_report(&arguments.recording, &page).map_err(Failure::usage)?;
    print.show(&Written { report: page }, |written| format!("report {}\n", written.report.display()));
    Ok(DONE)
}
