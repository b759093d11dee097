//! `yamabico run`: a task until its end, and what became of it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use yamabico_host::config::Task;
use yamabico_runtime::execution::Progress;
use yamabico_runtime::record::{Pace, Tee};
use yamabico_runtime::run::{Options, run as run_task};
use yamabico_runtime::supervisor::Program;

use super::TaskArguments;
use super::run_table::run_table;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail};

/// What `run` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Seed of everything that is drawn by chance.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads that the behaviors share in lockstep; the result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Run in real time instead of as fast as possible.
    #[arg(long)]
    live: bool,
    /// Where the recording goes; without it, to `run.mcap` in the output folder.
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Output folder; without it, `out/` and the task's name.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs the task and prints its table.
pub fn run(arguments: &Arguments, print: Print) -> ExitCode {
    let Some(task) = arguments.task.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    let interrupt = match interrupt_flag() {
        Ok(flag) => flag,
        Err(error) => return fail(&format!("cannot listen for Ctrl-C: {error}"), DEVICE_FAILED),
    };
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("out").join(&task.name));
    let options = Options {
        seed: arguments.seed,
        threads: usize::from(arguments.threads),
        recording: Some(arguments.record.clone().unwrap_or_else(|| out.join("run.mcap"))),
        pace: if arguments.live { Pace::Live } else { Pace::Lockstep },
        pictures: Some(out),
        overrides: arguments.task.overrides(),
        program: Some(Program::this()),
    };
    let bar = progress_bar(&task, print);
    let mut show = |progress| show_progress(&bar, &task, progress);
    let outcome = run_task(&task, &options, &interrupt, &mut Tee::default(), &mut show);
    bar.finish_and_clear();
    match outcome {
        Ok(ran) => {
            print.show(&ran, run_table);
            if let Some(problem) = &ran.trajectory_problem {
                eprintln!("warning: {problem}");
            }
            exit(if ran.is_done() { DONE } else { NOT_ARRIVED })
        }
        Err(error) => {
            fail(&error.to_string(), if error.is_of_a_device() { DEVICE_FAILED } else { BAD_CONFIGURATION })
        }
    }
}

/// Set by Ctrl-C and by SIGTERM: the robot is stopped first. A second Ctrl-C ends the program at once; the drive's watchdog
/// then stops the robot.
pub(crate) fn interrupt_flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&flag))?;
        signal_hook::flag::register(signal, Arc::clone(&flag))?;
    }
    // A file that grows beyond its limit costs the recording, not the run.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    Ok(flag)
}

fn progress_bar(task: &Task, print: Print) -> ProgressBar {
    let length = task.run.duration.map_or(0, |duration| duration.as_millis() as u64);
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr_with_hz(10));
    if print == Print::Json {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(task.name.clone());
    bar
}

fn show_progress(bar: &ProgressBar, task: &Task, progress: Progress) {
    // Drawing is limited to 10 Hz; so is formatting what is drawn.
    let elapsed = progress.elapsed.as_millis() as u64;
    if elapsed < bar.position() + 100 {
        return;
    }
    bar.set_position(elapsed.max(bar.position()));
    let seconds = Duration::as_secs_f64(&progress.elapsed);
    bar.set_message(match progress.to_go_m {
        Some(to_go_m) if task.run.goal.is_some() => format!("{seconds:.1} s, {to_go_m:.1} m to go"),
        _ => format!("{seconds:.1} s"),
    });
}
