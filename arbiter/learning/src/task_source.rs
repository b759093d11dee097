//! The task that is driven in order to learn.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use yamabico_core::plugins::Plugins;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::{Progress, RunEnd};
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

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
}

impl TaskSource {
    /// Loads and checks the task.
    ///
    /// # Errors
    /// [`LearningError::Configuration`], with every mistake.
    pub fn load(&self) -> Result<Task, LearningError> {
        load(&self.file, &self.overrides, &self.plugins).map_err(LearningError::Configuration)
    }

    /// Drives `task` once in lockstep, shows every message to `tap` and returns why the drive ended.
    pub(crate) fn drive(
        &self,
        task: &Task,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(&Task, Progress),
    ) -> Result<RunEnd, LearningError> {
        let options = Options { seed: self.seed, overrides: self.overrides.clone(), ..Options::default() };
        let never = AtomicBool::new(false);
        let result = run(task, &options, &never, tap, &mut |state| progress(task, state))?;
        Ok(result.end)
    }
}
