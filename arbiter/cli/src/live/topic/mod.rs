//! `yamabico topic`: what a running robot's parts tell each other.

mod echo;
mod list;
mod measure;

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Subcommand;
use yamabico_runtime::operator::{ListenError, Listener, LookError};

use super::which::Which;
use crate::commands::run::interrupt_flag;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, NOT_ARRIVED, Print, fail};

/// Longest sleep without a look at Ctrl-C.
const NAP: Duration = Duration::from_millis(100);
/// Who waits longer for a message is told so.
const WAITING: Duration = Duration::from_secs(2);

/// What to do with topics.
#[derive(Subcommand)]
pub enum Topic {
    /// List the topics: what each carries and who publishes on it.
    List(list::Arguments),
    /// Measure how often messages arrive.
    Hz(measure::Arguments),
    /// Print messages.
    Echo(echo::Arguments),
    /// Measure how old messages are on arrival, from the instant that a sensor measured.
    Latency(measure::Arguments),
}

impl Topic {
    /// Does it.
    pub fn run(self, print: Print) -> ExitCode {
        match self {
            Topic::List(arguments) => list::list(&arguments, print),
            Topic::Hz(arguments) => measure::hz(&arguments, print),
            Topic::Echo(arguments) => echo::echo(&arguments, print),
            Topic::Latency(arguments) => measure::latency(&arguments, print),
        }
    }
}

/// A listener to `topic` of the chosen robot, and what Ctrl-C sets; else what to exit with, told.
fn listen(which: &Which, topic: &str) -> Result<(Listener, Arc<AtomicBool>), ExitCode> {
    let robot = which.choose().map_err(|problem| fail(&problem, BAD_CONFIGURATION))?;
    let flag = interrupt_flag()
        .map_err(|error| fail(&format!("cannot listen for Ctrl-C: {error}"), DEVICE_FAILED))?;
    let listener = Listener::join(&robot, topic).map_err(|error| told(&error))?;
    Ok((listener, flag))
}

fn told(error: &ListenError) -> ExitCode {
    let code = match error {
        ListenError::Look(LookError::NoRoster | LookError::NoDecision) => NOT_ARRIVED,
        _ => BAD_CONFIGURATION,
    };
    fail(&error.to_string(), code)
}
