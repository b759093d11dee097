//! `yamabico learn map`: a map of the vertical edges of a building.

use std::path::PathBuf;

use clap::Args;
use yamabico_learning::edge_map::{self, Learned, Options};

use super::{DriveArguments, show_progress, warn};
use crate::output::{CommandResult, DONE, Print, table};
use crate::task_arguments::TaskArguments;

/// Arguments of `learn map`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Map to write.
    #[arg(long, value_name = "FILE.toml", default_value = "map.toml")]
    out: PathBuf,
    /// Plot of the map to write; by default beside the map.
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
    /// Sway of the camera about the vertical between frames, standard deviation, degrees, 0.01 to 10.
    #[arg(long, value_name = "DEG", default_value_t = 0.1)]
    sway_deg: f64,
    /// Reads this recording of an earlier drive instead of driving.
    #[arg(long, value_name = "FILE.mcap", conflicts_with_all = ["verify", "seed", "live"])]
    from: Option<PathBuf>,
    /// Drives a second time, on the new map, and faces every surface with a sonar to verify that it is solid.
    #[arg(long)]
    verify: bool,
    #[command(flatten)]
    drive: DriveArguments,
}

/// Learns the map and prints its edges.
pub fn learn(arguments: &Arguments, print: Print) -> CommandResult {
    let options = Options {
        map: arguments.out.clone(),
        plot: arguments.plot.clone().unwrap_or_else(|| arguments.out.with_extension("png")),
        sway_deg: arguments.sway_deg,
        recording: arguments.from.clone(),
        verify: arguments.verify,
    };
    let source = arguments.drive.source(&arguments.task)?;
    let learned = edge_map::learn(&source, &options, &mut show_progress(print))?;
    warn(&learned.warnings);
    print.show(&learned, text);
    Ok(DONE)
}

fn text(learned: &Learned) -> String {
    let header = ["edge", "x m", "y m", "sigma m", "frames"];
    let mut edges = table(&header, 0..header.len());
    for edge in &learned.edges {
        edges.add_row([
            edge.number.to_string(),
            format!("{:.3}", edge.x_m),
            format!("{:.3}", edge.y_m),
            format!("{:.3}", edge.sigma_m),
            edge.frames.to_string(),
        ]);
    }
    format!(
        "{edges}\n{} edges and {} surfaces, {} of them verified, learned from {} frames\n\
         map {}: name it as `edge_map` of the map-localizer\nplot {}\n",
        learned.edges.len(),
        learned.surfaces,
        learned.verified,
        learned.frames,
        learned.map.display(),
        learned.plot.display()
    )
}
