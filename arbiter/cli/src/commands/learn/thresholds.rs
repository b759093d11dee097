//! `yamabico learn thresholds`: edge thresholds of an empty building, by location.

use std::path::PathBuf;

use clap::Args;
use yamabico_learning::thresholds::{self, Learned, Options};

use super::{show_progress, source};
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
    /// Random seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Learns the thresholds and prints them.
pub fn learn(arguments: &Arguments, print: Print) -> CommandResult {
    let options = Options {
        table: arguments.out.clone(),
        plot: arguments.plot.clone().unwrap_or_else(|| arguments.out.with_extension("png")),
        spacing_m: arguments.every,
    };
    let source = source(&arguments.task, arguments.seed);
    let learned = thresholds::learn(&source, &options, &mut show_progress(print))?;
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
    let mut text = format!("{places}\n");
    for refused in &learned.refused {
        text += &format!(
            "nothing learned at x {:.2} m, y {:.2} m, heading {:.0} deg: {}\n",
            refused.x_m, refused.y_m, refused.heading_deg, refused.reason
        );
    }
    text + &format!(
        "{} places learned from {} frames\ntable {}: name it as `thresholds` of the stationary-obstacle-avoider\nplot {}\n",
        learned.places.len(),
        learned.frames,
        learned.table.display(),
        learned.plot.display()
    )
}
