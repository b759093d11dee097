//! How often sonar readings tell a passage from a surface that fills it.
//!
//! `tell_passages [CASES]`: so many of each kind of sonar, 200 without a number; half of them passages.
//!
//! Each case is a world of its own: see [`cases`]. What is not told at all counts as wrong.

mod cases;

use std::process::ExitCode;

use cases::{CLEAN, Kind, POOR, Tally};

fn main() -> ExitCode {
    let cases = match std::env::args().nth(1).map(|text| text.parse()) {
        None => 200,
        Some(Ok(cases)) => cases,
        Some(Err(_)) => {
            eprintln!("tell_passages [CASES]");
            return ExitCode::FAILURE;
        }
    };
    for kind in [CLEAN, POOR] {
        match Tally::of(&kind, cases) {
            Ok(tally) => print(&kind, &tally),
            Err(problem) => {
                eprintln!("{problem}");
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}

fn print(kind: &Kind, tally: &Tally) {
    println!(
        "{}: {} of {} right ({:.1} %), {} undecided, {} passages taken for surfaces, {} surfaces taken for passages; \
         half decided within {:.2} s, 95 % within {:.1} s, all within {:.1} s",
        kind.name,
        tally.right,
        tally.cases,
        100.0 * f64::from(tally.right) / f64::from(tally.cases),
        tally.undecided,
        tally.passages_missed,
        tally.surfaces_missed,
        tally.quantile_s(0.5),
        tally.quantile_s(0.95),
        tally.quantile_s(1.0),
    );
}
