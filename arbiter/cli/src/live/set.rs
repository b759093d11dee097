//! `yamabico set`: other parameters for behaviors that run.

use std::process::ExitCode;

use clap::Args;
use serde_json::json;
use yamabico_host::config::assignments;
use yamabico_runtime::operator::{RetuneError, retune};

use super::which::Which;
use crate::output::{BAD_CONFIGURATION, DONE, NOT_ARRIVED, Print, exit, fail};

/// What `set` is told.
#[derive(Args)]
pub struct Arguments {
    /// A parameter and its new value, such as `wall-follower.speed_mps=0.2`: TOML, or a bare word for a text.
    #[arg(required = true, value_name = "BEHAVIOR.KEY=VALUE")]
    assignments: Vec<String>,
    #[command(flatten)]
    robot: Which,
}

/// Changes the parameters: all of them, or none where one is wrong.
pub fn set(arguments: &Arguments, print: Print) -> ExitCode {
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let changes = match assignments(arguments.assignments.iter().map(String::as_str)) {
        Ok(changes) => changes,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    if let Some((key, _)) = changes.iter().find(|(_, value)| !value.is_table()) {
        let problem = format!("`{key}` names no parameter: write BEHAVIOR.KEY=VALUE");
        return fail(&problem, BAD_CONFIGURATION);
    }
    match retune(&robot, &changes) {
        Ok(took) => {
            let took_s = took.as_secs_f64();
            let answer = json!({ "robot": robot, "set": arguments.assignments, "took_s": took_s });
            print.show(&answer, |_| {
                format!("{robot}: {} in force after {took_s:.2} s", arguments.assignments.join(", "))
            });
            exit(DONE)
        }
        Err(error @ (RetuneError::Silent | RetuneError::TooLong)) => fail(&error.to_string(), NOT_ARRIVED),
        Err(error) => fail(&error.to_string(), BAD_CONFIGURATION),
    }
}
