//! `yamabico estop` and `yamabico reset`: the latched emergency stop of a running robot.

use clap::Args;
use serde_json::json;
use yamabico_core::message::{Mode, Twist};
use yamabico_runtime::client::{Request, RequestResult, RobotClient};

use crate::output::{CommandResult, DONE, Failure, Print};
use crate::robot_argument::RobotArgument;

/// Arguments of `estop` and `reset`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: RobotArgument,
}

/// Stops the robot until a reset, and waits until no motion is commanded.
pub fn estop(arguments: &Arguments, print: Print) -> CommandResult {
    let (robot, result) = request(&arguments.robot, &Request::EmergencyStop)?;
    let took_s = result.took.as_secs_f64();
    let answer = json!({ "robot": robot, "state": "emergency stop", "took_s": took_s });
    print.show(&answer, |_| {
        let stop = match result.before.header.commanded == Twist::ZERO {
            true => "no motion was commanded before".to_owned(),
            false => format!("zero velocity is commanded after {took_s:.2} s"),
        };
        format!("{robot}: emergency stop latched; {stop}. Release it with `yamabico reset`")
    });
    Ok(DONE)
}

/// Releases the emergency stop.
pub fn reset(arguments: &Arguments, print: Print) -> CommandResult {
    let (robot, result) = request(&arguments.robot, &Request::Reset)?;
    let mode = result.after.header.mode().map_or("unknown", Mode::as_str);
    let answer = json!({ "robot": robot, "state": mode, "changed": result.changed });
    print.show(&answer, |_| {
        let done = match result.changed {
            true => "emergency stop released",
            false => "no emergency stop was latched",
        };
        format!("{robot}: {done}; mode of the robot: {mode}")
    });
    Ok(DONE)
}

/// Sends a request to the chosen robot; returns its name and its answer.
pub(super) fn request(robot: &RobotArgument, request: &Request) -> Result<(String, RequestResult), Failure> {
    let robot = robot.choose()?;
    let result = RobotClient::join(&robot)?.request(request)?;
    Ok((robot, result))
}
