//! The progress bar of a run, on standard error; hidden if that is not a terminal or results are printed as JSON.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use yamabico_host::config::Task;
use yamabico_runtime::execution::Progress;

use crate::output::{Print, printable};

/// The progress bar of one run.
pub struct RunProgress(ProgressBar);

impl RunProgress {
    /// Creates a bar as long as the task lasts at most.
    pub fn new(task: &Task, prefix: &str, print: Print) -> RunProgress {
        let length = task.run.duration.map_or(0, |duration| duration.as_millis() as u64);
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr_with_hz(10));
        if print == Print::Json {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        set_style(&bar, &format!("{prefix}{}", task.name));
        RunProgress(bar)
    }

    /// Shows the elapsed time and, if the task has a goal, the remaining distance.
    pub fn show(&self, task: &Task, progress: Progress) {
        // Drawing is limited to 10 Hz; so is formatting.
        let elapsed = progress.elapsed.as_millis() as u64;
        if elapsed < self.0.position() + 100 {
            return;
        }
        self.0.set_position(elapsed.max(self.0.position()));
        let seconds = Duration::as_secs_f64(&progress.elapsed);
        self.0.set_message(match progress.to_go_m {
            Some(to_go_m) if task.run.goal.is_some() => format!("{seconds:.1} s, {to_go_m:.1} m to go"),
            _ => format!("{seconds:.1} s"),
        });
    }
}

impl Drop for RunProgress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Sets the common style: the prefix, the bar and a message.
pub fn set_style(bar: &ProgressBar, prefix: &str) {
    if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(printable(prefix).into_owned());
}
