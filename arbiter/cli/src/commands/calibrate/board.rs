//! `yamabico calibrate board`: the checkerboard to print.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use yamabico_learning::calibration::board_page;

use super::BoardArguments;
use crate::output::{CommandResult, DONE, Print};

/// Arguments of `calibrate board`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    board: BoardArguments,
    /// Size of the paper.
    #[arg(long, value_enum, default_value_t = Paper::A4)]
    paper: Paper,
    /// File to write.
    #[arg(long, value_name = "FILE.pdf", default_value = "board.pdf")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Paper {
    /// 210 x 297 mm.
    A4,
    /// 8.5 x 11 inches.
    Letter,
    /// 297 x 420 mm.
    A3,
}

#[derive(Serialize)]
struct Page {
    file: PathBuf,
    paper: board_page::Paper,
}

/// Writes the page.
pub fn write(arguments: &Arguments, print: Print) -> CommandResult {
    let paper = match arguments.paper {
        Paper::A4 => board_page::Paper::A4,
        Paper::Letter => board_page::Paper::Letter,
        Paper::A3 => board_page::Paper::A3,
    };
    board_page::write(&arguments.out, &arguments.board.board()?, paper)?;
    print.show(&Page { file: arguments.out.clone(), paper }, |page| {
        format!(
            "page {}: print it at 100 %, without scaling to fit, and check the bar with a ruler; glue it to something flat and stiff,\n\
             such as glass or a clipboard, and give the measured side of a square as --square-mm",
            page.file.display()
        )
    });
    Ok(DONE)
}
