//! `yamabico enable` and `yamabico disable`: behaviors of a running robot, switched on and off.

use clap::Args;
use serde_json::json;
use yamabico_core::message::{Mode, Outcome, Verdict};
use yamabico_runtime::client::{Request, RequestResult};

use super::estop::request;
use crate::output::{CommandResult, DONE, Print};
use crate::robot_argument::RobotArgument;

/// Arguments of `enable` and `disable`.
#[derive(Args)]
pub struct Arguments {
    /// Name of the behavior in the task file.
    behavior: String,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Enables the behavior.
pub fn enable(arguments: &Arguments, print: Print) -> CommandResult {
    switch(arguments, Request::Enable(arguments.behavior.clone()), "enabled", print)
}

/// Disables the behavior.
pub fn disable(arguments: &Arguments, print: Print) -> CommandResult {
    switch(arguments, Request::Disable(arguments.behavior.clone()), "disabled", print)
}

fn switch(arguments: &Arguments, switch: Request, state: &str, print: Print) -> CommandResult {
    let (robot, result) = request(&arguments.robot, &switch)?;
    let name = &arguments.behavior;
    let outcome = result.after.verdict(name).and_then(Verdict::outcome);
    let answer = json!({
        "robot": robot,
        "behavior": name,
        "state": state,
        "changed": result.changed,
        "outcome": outcome.map(Outcome::as_str),
        "mode": result.after.header.mode().map(Mode::as_str),
    });
    print.show(&answer, |_| {
        let verb = if result.changed { "is" } else { "was already" };
        format!("{robot}: {name} {verb} {state}; {}", consequence(name, &result))
    });
    Ok(DONE)
}

/// The outcome of the behavior's newest proposal, and the mode of the robot.
fn consequence(name: &str, result: &RequestResult) -> String {
    let verdict = result.after.verdict(name);
    let outcome = verdict.and_then(Verdict::outcome).filter(|outcome| *outcome != Outcome::Disabled);
    let outcome =
        outcome.map_or(String::new(), |outcome| format!("outcome of its newest proposal: {outcome}; "));
    let mode = result.after.header.mode().map_or("unknown", Mode::as_str);
    let note = result.after.header.note;
    let note = if note.is_empty() { String::new() } else { format!(" ({note})") };
    format!("{outcome}mode of the robot: {mode}{note}")
}
