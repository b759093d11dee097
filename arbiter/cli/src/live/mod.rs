//! The commands for a robot that runs live.

mod estop;
mod switch;
pub mod which;

use std::process::ExitCode;

use clap::Subcommand;

use crate::output::Print;

/// What to do with a running robot.
#[derive(Subcommand)]
pub enum Command {
    /// Let a behaviour of a running robot be heard again.
    Enable(switch::Arguments),
    /// Let a behaviour of a running robot not be heard.
    Disable(switch::Arguments),
    /// Stop a running robot at once, until `reset`.
    Estop(estop::Arguments),
    /// Release the emergency stop of a running robot.
    Reset(estop::Arguments),
}

impl Command {
    /// Does it.
    pub fn run(self, print: Print) -> ExitCode {
        match self {
            Command::Enable(arguments) => switch::enable(&arguments, print),
            Command::Disable(arguments) => switch::disable(&arguments, print),
            Command::Estop(arguments) => estop::estop(&arguments, print),
            Command::Reset(arguments) => estop::reset(&arguments, print),
        }
    }
}
