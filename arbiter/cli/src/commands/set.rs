//! `yamabico set`: new parameters for running behaviors.

use clap::Args;
use serde_json::json;
use yamabico_host::config::assignments;
use yamabico_runtime::client::RobotClient;

use crate::output::{CommandResult, DONE, Failure, Print};
use crate::robot_argument::RobotArgument;

/// Arguments of `set`.
#[derive(Args)]
pub struct Arguments {
    /// Parameter and its new value, for example `wall-follower.speed_mps=0.2`. The value is TOML; quotes around a text may be
    /// left out.
    #[arg(required = true, value_name = "BEHAVIOR.KEY=VALUE")]
    assignments: Vec<String>,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Changes the parameters: all of them, or none if one is refused.
pub fn set(arguments: &Arguments, print: Print) -> CommandResult {
    let robot = arguments.robot.choose()?;
    let changes = assignments(arguments.assignments.iter().map(String::as_str)).map_err(Failure::usage)?;
    if let Some((key, _)) = changes.iter().find(|(_, value)| !value.is_table()) {
        return Err(Failure::usage(format!("`{key}` is not a parameter: write BEHAVIOR.KEY=VALUE")));
    }
    let took_s = RobotClient::join(&robot)?.set_parameters(&changes)?.as_secs_f64();
    let answer = json!({ "robot": robot, "set": arguments.assignments, "took_s": took_s });
    print.show(&answer, |_| {
        format!("{robot}: {} in effect after {took_s:.2} s", arguments.assignments.join(", "))
    });
    Ok(DONE)
}
