//! `yamabico learn thresholds`: edge thresholds of an empty building, by location.

use std::path::PathBuf;

use clap::Args;
use yamabico_learning::thresholds::{self, Learned, Options};

use super::{DriveArguments, show_progress, warn};
use crate::output::{CommandResult, DONE, NOT_DONE, Print, table};
use crate::task_arguments::TaskArguments;

/// Arguments of `learn thresholds`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Table to write.
    #[arg(long, value_name = "FILE.toml", default_value = "thresholds.toml")]
    out: PathBuf,
    /// Plot to write, of the differing pixels over the threshold; by default beside the table.
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
    /// Distance between places, m, 0.05 to 10.
    #[arg(long, value_name = "M", default_value_t = 0.5)]
    every: f64,
    /// Reads this recording of an earlier drive instead of driving.
    #[arg(long, value_name = "FILE.mcap", conflicts_with_all = ["seed", "live"])]
    from: Option<PathBuf>,
    #[command(flatten)]
    drive: DriveArguments,
}

/// Learns the thresholds and prints them.
pub fn learn(arguments: &Arguments, print: Print) -> CommandResult {
    let options = Options {
        table: arguments.out.clone(),
        plot: arguments.plot.clone().unwrap_or_else(|| arguments.out.with_extension("png")),
        spacing_m: arguments.every,
        recording: arguments.from.clone(),
    };
    let source = arguments.drive.source(&arguments.task)?;
    let learned = thresholds::learn(&source, &options, &mut show_progress(print))?;
    warn(&learned.warnings);
    print.show(&learned, text);
    Ok(if learned.places.is_empty() { NOT_DONE } else { DONE })
}

fn text(learned: &Learned) -> String {
    let header = ["x m", "y m", "heading", "T0", "N0", "unexplained", "contrast", "level", "recall"];
    let mut places = table(&header, 0..header.len());
    for place in &learned.places {
        places.add_row([
            format!("{:.2}", place.x_m),
            format!("{:.2}", place.y_m),
            format!("{:.1}", place.heading_deg),
            place.t0.to_string(),
            place.n0.to_string(),
            place.n0_extra.to_string(),
            format!("{:.1}", place.contrast),
            place.level.to_string(),
            format!("{:.2}", place.recall),
        ]);
    }
    let mut text = if learned.places.is_empty() { String::new() } else { format!("{places}\n") };
    for refused in &learned.refused {
        text += &format!("{refused}\n");
    }
    text += &format!("{} places learned from {} frames\n", learned.places.len(), learned.frames);
    match &learned.table {
        Some(table) => {
            text += &format!(
                "table {}: name it as `thresholds` of the stationary-obstacle-avoider\n",
                table.display()
            );
        }
        None if learned.frames == 0 => {
            text += "no table is written: no frame came with a pose estimate in state `tracking`\n";
        }
        None => text += "no table is written: no place could be learned\n",
    }
    if let Some(plot) = &learned.plot {
        text += &format!("plot {}\n", plot.display());
    }
    text
}
