//! The commands for a robot that runs live.

mod estop;
mod ps;
mod set;
mod switch;
mod teleop;
mod topic;
pub mod which;
mod why;

use std::process::ExitCode;

use clap::Subcommand;

use crate::output::Print;

/// What to do with a running robot.
#[derive(Subcommand)]
pub enum Command {
    /// Tell why a running robot does what it does.
    Why(why::Arguments),
    /// List the plugins of a running robot and how they fare.
    Ps(ps::Arguments),
    /// Listen to what a running robot's parts tell each other.
    #[command(subcommand)]
    Topic(topic::Topic),
    /// Let a behavior of a running robot be heard again.
    Enable(switch::Arguments),
    /// Let a behavior of a running robot not be heard.
    Disable(switch::Arguments),
    /// Change parameters of behaviors that run: all of them, or none where one is wrong.
    Set(set::Arguments),
    /// Drive a running robot by the keys of this terminal.
    Teleop(teleop::Arguments),
    /// Stop a running robot at once, until `reset`.
    Estop(estop::Arguments),
    /// Release the emergency stop of a running robot.
    Reset(estop::Arguments),
}

impl Command {
    /// Does it.
    pub fn run(self, print: Print) -> ExitCode {
        match self {
            Command::Why(arguments) => why::why(&arguments, print),
            Command::Ps(arguments) => ps::ps(&arguments, print),
            Command::Topic(what) => what.run(print),
            Command::Enable(arguments) => switch::enable(&arguments, print),
            Command::Disable(arguments) => switch::disable(&arguments, print),
            Command::Set(arguments) => set::set(&arguments, print),
            Command::Teleop(arguments) => teleop::teleop(&arguments, print),
            Command::Estop(arguments) => estop::estop(&arguments, print),
            Command::Reset(arguments) => estop::reset(&arguments, print),
        }
    }
}
