//! Tie between a plugin's process and the supervisor that started it.

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};

/// Effect of the parent's death on a plugin's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnParentDeath {
    /// SIGKILL: the process dies at once.
    Die,
    /// SIGHUP: the process stops its drive and then ends.
    Brake,
}

/// Parent of a plugin's process, which must not outlive it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParentProcess {
    /// Process id.
    pub pid: u32,
    /// Effect of its death.
    pub on_death: OnParentDeath,
}

impl ParentProcess {
    /// Ties this process to its parent, even across `exec`. Returns false if the parent is already dead.
    ///
    /// # Errors
    /// The operating system refused.
    pub fn follow(self) -> std::io::Result<bool> {
        let signal = match self.on_death {
            OnParentDeath::Die => Signal::KILL,
            OnParentDeath::Brake => Signal::HUP,
        };
        set_parent_process_death_signal(Some(signal))?;
        // A parent that died before the line above sends no signal.
        Ok(getppid().and_then(|pid| u32::try_from(Pid::as_raw(Some(pid))).ok()) == Some(self.pid))
    }
}
