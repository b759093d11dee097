//! The task that is driven in order to learn, or the recording of an earlier drive.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use yamabico_core::plugins::Plugins;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::{Progress, RunEnd};
use yamabico_runtime::record::{Pace, Tap, play};
use yamabico_runtime::run::{Options, run};
use yamabico_runtime::supervisor::Program;

use crate::LearningError;

/// A task file with everything needed to load and drive it.
#[derive(Clone, Debug)]
pub struct TaskSource {
    /// The task file.
    pub file: PathBuf,
    /// Changes from the command line.
    pub overrides: Overrides,
    /// Behaviors and drivers that the task may name.
    pub plugins: Plugins,
    /// Random seed of the drive.
    pub seed: u64,
    /// Program of the plugins' processes for a drive in real time, as a world outside or a real robot needs it; `None`
    /// for a drive in lockstep.
    pub live: Option<Program>,
    /// Once set, stops the robot and ends the drive.
    pub interrupt: Arc<AtomicBool>,
}

impl TaskSource {
    /// Loads and checks the task.
    ///
    /// # Errors
    /// [`LearningError::Configuration`], with every mistake.
    pub fn load(&self) -> Result<Task, LearningError> {
        load(&self.file, &self.overrides, &self.plugins).map_err(LearningError::Configuration)
    }

    /// Drives `task` once, shows every message to `tap` and returns why the drive ended.
    pub(crate) fn drive(
        &self,
        task: &Task,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(&Task, Progress),
    ) -> Result<RunEnd, LearningError> {
        let options = Options {
            seed: self.seed,
            overrides: self.overrides.clone(),
            pace: if self.live.is_some() { Pace::Live } else { Pace::Lockstep },
            program: self.live.clone(),
            ..Options::default()
        };
        let result = run(task, &options, &self.interrupt, tap, &mut |state| progress(task, state))?;
        Ok(result.end)
    }
}

/// Shows every message of a recording to `tap`; returns what was not used, for people.
pub(crate) fn play_recording(recording: &Path, tap: &mut dyn Tap) -> Result<Vec<String>, LearningError> {
    let played = play(recording, tap)?;
    let file = recording.display();
    let skipped = played.left_out.iter().map(|left_out| format!("{file}: skipped: {left_out}"));
    let truncated = played
        .broken_off
        .iter()
        .map(|reason| format!("{file} is truncated after {} messages: {reason}", played.messages));
    Ok(skipped.chain(truncated).collect())
}
