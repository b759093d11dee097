//! `yamabico run`: a task from start to end.

use std::path::{Path, PathBuf};

use clap::Args;
use yamabico_runtime::execution::Overlays;
use yamabico_runtime::record::{Pace, RunFolder, Tee};
use yamabico_runtime::run::{Options, Report, run as run_task};
use yamabico_runtime::supervisor::Program;

use super::run_table::run_table;
use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure, NOT_DONE, Print, complain, printable};
use crate::progress::RunProgress;
use crate::task_arguments::TaskArguments;

/// Arguments of `run`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Random seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of threads for the behaviors in lockstep; the result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Run in real time, each plugin in its own process, instead of in lockstep as fast as possible.
    #[arg(long)]
    live: bool,
    /// Recording to write; by default `run.mcap` in the output folder.
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Record without the overlays of the behaviors: what each of them saw, drawn over its input.
    #[arg(long)]
    no_overlays: bool,
    /// Do not write a report, an HTML file beside the recording.
    #[arg(long)]
    no_report: bool,
    /// Output folder; by default a new one for each run, `out/TASK/TIME`, to which the link `out/TASK/latest` points.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace an existing recording.
    #[arg(long)]
    overwrite: bool,
}

/// Runs the task and prints its table.
pub fn run(arguments: &Arguments, print: Print) -> CommandResult {
    let task = arguments.task.load()?;
    for note in task.notes() {
        eprintln!("note: {}", printable(&note));
    }
    let interrupt = interrupt_flag()?;
    let folder = match &arguments.out {
        Some(_) => None,
        None => Some(RunFolder::create(&Path::new("out").join(&task.name)).map_err(Failure::device)?),
    };
    let out = arguments.out.as_deref().or(folder.as_ref().map(RunFolder::path)).unwrap_or(Path::new("."));
    let options = Options {
        seed: arguments.seed,
        threads: usize::from(arguments.threads),
        recording: Some(arguments.record.clone().unwrap_or_else(|| out.join("run.mcap"))),
        overwrite: arguments.overwrite,
        overlays: if arguments.no_overlays { Overlays::OnRequest } else { Overlays::Recorded },
        report: if arguments.no_report { Report::None } else { Report::BesideRecording },
        pace: if arguments.live { Pace::Live } else { Pace::Lockstep },
        plots: Some(out.to_owned()),
        overrides: arguments.task.overrides(),
        program: Some(Program::this()),
    };
    let bar = RunProgress::new(&task, "", print);
    // The newest run is one that has begun.
    let mut unlinked = folder.as_ref();
    let result = run_task(&task, &options, &interrupt, &mut Tee::default(), &mut |state| {
        bar.show(&task, state);
        unlinked.take().into_iter().for_each(RunFolder::link);
    });
    drop(bar);
    let result = result.map_err(|error| {
        folder.iter().for_each(RunFolder::remove_if_empty);
        match error.is_of_a_device() {
            true => Failure::device(error),
            false => Failure::usage(error),
        }
    })?;
    print.show(&result, run_table);
    for problem in [&result.trajectory_problem, &result.report_problem].into_iter().flatten() {
        complain(&format!("warning: {}", printable(problem)));
    }
    Ok(if result.is_done() { DONE } else { NOT_DONE })
}
