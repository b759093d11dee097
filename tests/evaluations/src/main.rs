//! Evaluations of Yamabico: sweeps over simulated worlds, scores on recorded data, and runs of whole tasks.
//!
//!     cargo run --release -p yamabico-evaluations -- --help
//!
//! All take seeds (`--seeds FIRST..LAST`), the data folder (an argument, or `YAMABICO_DATA`) and the folder for images (`--out DIR`)
//! alike, and print tables, or JSON with `--json`. Exit code 1: the evaluation found what must not be; 2: it could not run.

mod arguments;
mod boxes;
mod buildings;
mod calibration;
mod images;
mod live;
mod overlay_cost;
mod photographs;
mod recording_speed;
mod recordings;
mod render;
mod rendered;
mod replays;
mod report;
mod scenes;
mod show;
mod statistics;
mod tasks;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::images::Output;
use crate::report::Report;

/// Sweeps over simulated worlds, scores on recorded data, and runs of whole tasks.
#[derive(Parser)]
#[command(name = "yamabico-evaluations")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Folder for images.
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Command {
    YorkUrban(photographs::york_urban::Arguments),
    CorridorDrive(photographs::corridor_drive::Arguments),
    MultiFloor(photographs::multi_floor::Arguments),
    Calibration(calibration::Arguments),
    NoCorridor(photographs::no_corridor::Arguments),
    Reliability(photographs::reliability::Arguments),
    FloorMasks(photographs::floor_masks::Arguments),
    MirrorFloors(photographs::mirror_floors::Arguments),
    Beacons(recordings::beacons::Arguments),
    Landmarks(recordings::landmarks::Arguments),
    Halts(recordings::halts::Arguments),
    CorridorViews(rendered::corridor_views::Arguments),
    Approaches(rendered::approaches::Arguments),
    PoseFixes(rendered::pose_fixes::Arguments),
    Passages(rendered::passages::Arguments),
    Boxes(boxes::Arguments),
    SweepBuildings(buildings::Arguments),
    Scenes(scenes::Arguments),
    Runs(tasks::runs::Arguments),
    Localization(tasks::localization::Arguments),
    Settings(tasks::settings::Arguments),
    RecordingSpeed(recording_speed::Arguments),
    OverlayCost(overlay_cost::Arguments),
    Replays(replays::Arguments),
    Chaos(live::chaos::Arguments),
    Busy(live::busy::Arguments),
    Soak(live::soak::Arguments),
    Viewing(live::viewing::Arguments),
    PythonFailures(live::python_failures::Arguments),
    /// Run a behavior on one image, and draw what it detected.
    #[command(subcommand)]
    Show(show::Command),
    /// Render images and maps of a simulated world.
    #[command(subcommand)]
    Render(render::Command),
}

impl Command {
    fn run(&self, out: &Output) -> Result<Report, String> {
        match self {
            Self::YorkUrban(arguments) => arguments.run(out),
            Self::CorridorDrive(arguments) => arguments.run(out),
            Self::MultiFloor(arguments) => arguments.run(out),
            Self::Calibration(arguments) => arguments.run(out),
            Self::NoCorridor(arguments) => arguments.run(out),
            Self::Reliability(arguments) => arguments.run(out),
            Self::FloorMasks(arguments) => arguments.run(),
            Self::MirrorFloors(arguments) => arguments.run(),
            Self::Beacons(arguments) => arguments.run(),
            Self::Landmarks(arguments) => arguments.run(),
            Self::Halts(arguments) => arguments.run(out),
            Self::CorridorViews(arguments) => arguments.run(out),
            Self::Approaches(arguments) => arguments.run(out),
            Self::PoseFixes(arguments) => arguments.run(),
            Self::Passages(arguments) => arguments.run(),
            Self::Boxes(arguments) => arguments.run(out),
            Self::SweepBuildings(arguments) => arguments.run(),
            Self::Scenes(arguments) => arguments.run(out),
            Self::Runs(arguments) => arguments.run(),
            Self::Localization(arguments) => arguments.run(),
            Self::Settings(arguments) => arguments.run(out),
            Self::RecordingSpeed(arguments) => arguments.run(),
            Self::OverlayCost(arguments) => arguments.run(),
            Self::Replays(arguments) => arguments.run(),
            Self::Chaos(arguments) => arguments.run(),
            Self::Busy(arguments) => arguments.run(),
            Self::Soak(arguments) => arguments.run(),
            Self::Viewing(arguments) => arguments.run(),
            Self::PythonFailures(arguments) => arguments.run(),
            Self::Show(command) => command.run(out),
            Self::Render(command) => command.run(out),
        }
    }
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match Output::new(cli.out).and_then(|out| cli.command.run(&out)) {
        Ok(report) => {
            report.print(cli.json);
            match report.failure() {
                None => ExitCode::SUCCESS,
                Some(problem) => {
                    eprintln!("failed: {problem}");
                    ExitCode::from(1)
                }
            }
        }
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::from(2)
        }
    }
}
