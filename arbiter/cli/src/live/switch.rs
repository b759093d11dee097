//! `yamabico enable` and `yamabico disable`: whether a behavior of a running robot is heard.

use std::process::ExitCode;

use clap::Args;
use serde_json::json;
use yamabico_core::message::{Mode, Outcome, Verdict};
use yamabico_runtime::operator::{Obeyed, Request};

use super::estop::ask;
use super::which::Which;
use crate::output::{DONE, Print, exit};

/// What `enable` and `disable` are told.
#[derive(Args)]
pub struct Arguments {
    /// The behavior, as the task names it.
    behavior: String,
    #[command(flatten)]
    robot: Which,
}

/// Lets the behavior be heard.
pub fn enable(arguments: &Arguments, print: Print) -> ExitCode {
    switch(arguments, Request::Enable(arguments.behavior.clone()), "enabled", print)
}

/// Lets the behavior not be heard.
pub fn disable(arguments: &Arguments, print: Print) -> ExitCode {
    switch(arguments, Request::Disable(arguments.behavior.clone()), "disabled", print)
}

fn switch(arguments: &Arguments, request: Request, done: &str, print: Print) -> ExitCode {
    let (robot, obeyed) = match ask(&arguments.robot, &request) {
        Ok(answer) => answer,
        Err(code) => return code,
    };
    let name = &arguments.behavior;
    let outcome = obeyed.after.verdict(name).and_then(Verdict::outcome);
    let answer = json!({
        "robot": robot,
        "behavior": name,
        "state": done,
        "changed": obeyed.changed,
        "outcome": outcome.map(Outcome::as_str),
        "mode": obeyed.after.header.mode().map(Mode::as_str),
    });
    print.show(&answer, |_| {
        let before = if obeyed.changed { "is" } else { "was already" };
        format!("{robot}: {name} {before} {done}; {}", now(name, &obeyed))
    });
    exit(DONE)
}

/// What became of the behavior, and what the robot does.
fn now(name: &str, obeyed: &Obeyed) -> String {
    let verdict = obeyed.after.verdict(name);
    let outcome = verdict.and_then(Verdict::outcome).filter(|outcome| *outcome != Outcome::Disabled);
    let outcome = outcome.map_or(String::new(), |outcome| format!("now {outcome}; "));
    let mode = obeyed.after.header.mode().map_or("in an unknown state", Mode::as_str);
    let note = obeyed.after.header.note;
    let note = if note.is_empty() { String::new() } else { format!(": {note}") };
    format!("{outcome}the robot is {mode}{note}")
}
