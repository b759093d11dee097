//! `yamabico replay`: a recorded run again, compared to the byte, or with changes.

mod tables;

use std::path::PathBuf;

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_runtime::execution::Overlays;
use yamabico_runtime::replay::{
    Changes, Options, Part, ReplayError, Report, close_loop, replay as replay_file, replay_runs,
};
use yamabico_runtime::supervisor::Program;

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure, NOT_DONE, Print};

/// Arguments of `replay`.
#[derive(Args)]
pub struct Arguments {
    /// Recording.
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Change a key of the recorded task and ask "what if", such as `wall-follower.speed_mps=0.2`. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Ask "what if" with another task on the recorded inputs.
    #[arg(long, value_name = "FILE.toml")]
    task: Option<PathBuf>,
    /// Ask "what if" without this behavior. May be repeated.
    #[arg(long, value_name = "BEHAVIOR")]
    without: Vec<String>,
    /// Ask "what if" with the behaviors of this file, tables as in a task file. In lockstep only. May be repeated.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "task")]
    with: Vec<PathBuf>,
    /// Ask "what if" for each of these values: a table.
    #[arg(long, value_name = "KEY=A,B,C", conflicts_with = "out")]
    sweep: Option<String>,
    /// Replay the behaviors from this time on only, s; they continue from what they had saved by then.
    #[arg(long, value_name = "S", conflicts_with = "closed")]
    from: Option<f64>,
    /// Replay the decisions alone, from the recorded proposals.
    #[arg(long, conflicts_with_all = ["from", "closed"])]
    decisions: bool,
    /// Close the loop: run the recorded simulation again with the changes, so that the world reacts.
    #[arg(long, conflicts_with = "out")]
    closed: bool,
    /// Recording to write, with the replayed messages under `/what-if/` beside the recorded ones.
    #[arg(long, value_name = "FILE.mcap")]
    out: Option<PathBuf>,
    /// Start the external programs that the recording names by `exec`; it may come from anybody, so read them first.
    #[arg(long)]
    programs: bool,
    /// Compare overlays, too, which every behavior then draws. In lockstep only.
    #[arg(long)]
    overlays: bool,
    /// Number of threads for the behaviors; by default one for each processor.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

impl Arguments {
    fn changes(&self, further: Option<String>) -> Changes {
        Changes {
            set: self.set.iter().cloned().chain(further).collect(),
            task: self.task.clone(),
            without: self.without.clone(),
            with: self.with.clone(),
        }
    }

    fn options(&self, further: Option<String>) -> Options {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Options {
            part: match self.from {
                Some(from_s) => Part::From(from_s),
                None if self.decisions => Part::Decisions,
                None => Part::Whole,
            },
            overlays: if self.overlays { Overlays::Recorded } else { Overlays::OnRequest },
            changes: self.changes(further),
            threads: self.threads.map_or(processors, usize::from),
            program: self.programs.then(Program::this),
            output: self.out.clone(),
        }
    }
}

/// Replays the recording: done if every message is equal, or if a what-if was answered.
pub fn replay(arguments: &Arguments, print: Print) -> CommandResult {
    if let Some(sweep) = &arguments.sweep {
        return sweep_values(arguments, sweep, print);
    }
    let options = arguments.options(None);
    if arguments.closed {
        let interrupt = interrupt_flag()?;
        let closed = close_loop(&arguments.file, &plugins(), &options, &interrupt, &mut |_| ());
        print.show(&closed.map_err(failure)?, tables::closed_loop);
        return Ok(DONE);
    }
    let reports = replay_runs(&arguments.file, &plugins(), &options).map_err(failure)?;
    let text = |report: &Report| match report.open_loop {
        true => tables::what_if(report),
        false => tables::comparison(report),
    };
    match reports.as_slice() {
        [report] => print.show(report, text),
        _ => print.show(&reports, |several| tables::runs(several, text)),
    }
    let is_done = reports.iter().all(|report| report.open_loop || report.is_equal());
    Ok(if is_done { DONE } else { NOT_DONE })
}

/// Answers one what-if for each value of `sweep`, and prints them as one table.
fn sweep_values(arguments: &Arguments, sweep: &str, print: Print) -> CommandResult {
    let Some((key, values)) = sweep.split_once('=') else {
        return Err(Failure::usage(
            "`--sweep` takes KEY=A,B,C, such as --sweep wall-follower.speed_mps=0.2,0.3",
        ));
    };
    let interrupt = interrupt_flag()?;
    let (mut open, mut closed) = (Vec::new(), Vec::new());
    for value in values.split(',') {
        let options = arguments.options(Some(format!("{key}={value}")));
        if arguments.closed {
            let ran = close_loop(&arguments.file, &plugins(), &options, &interrupt, &mut |_| ());
            closed.push((value.to_owned(), ran.map_err(failure)?));
        } else {
            let report = replay_file(&arguments.file, &plugins(), &options).map_err(failure)?;
            open.push((value.to_owned(), report));
        }
    }
    match arguments.closed {
        true => print.show(&closed, |closed| tables::closed_sweep(key, closed)),
        false => print.show(&open, |open| tables::open_sweep(key, open)),
    }
    Ok(DONE)
}

fn failure(error: ReplayError) -> Failure {
    match error {
        ReplayError::Task(problems) => Failure::Configuration(problems),
        ReplayError::Device(_) | ReplayError::Record(_) | ReplayError::Unpack { .. } => {
            Failure::device(error)
        }
        _ => Failure::usage(error),
    }
}
