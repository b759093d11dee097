//! `yamabico estop` and `yamabico reset`: the latched emergency stop of a running robot.

use std::process::ExitCode;

use clap::Args;
use serde_json::json;
use yamabico_core::message::{Mode, Twist};
use yamabico_runtime::operator::{Desk, Obeyed, Request, RequestError};

use super::which::Which;
use crate::output::{BAD_CONFIGURATION, DONE, NOT_ARRIVED, Print, exit, fail};

/// What `estop` and `reset` are told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: Which,
}

/// Stops the robot until a reset, and waits until no motion is commanded.
pub fn estop(arguments: &Arguments, print: Print) -> ExitCode {
    match ask(&arguments.robot, &Request::EmergencyStop) {
        Ok((robot, obeyed)) => {
            let took_s = obeyed.took.as_secs_f64();
            let answer = json!({ "robot": robot, "state": "emergency stop", "took_s": took_s });
            print.show(&answer, |_| {
                let stands = match obeyed.before.header.commanded == Twist::ZERO {
                    true => "it stood already".to_owned(),
                    false => format!("it was commanded to rest within {took_s:.2} s"),
                };
                format!("{robot}: emergency stop latched; {stands}. Release it with `yamabico reset`")
            });
            exit(DONE)
        }
        Err(code) => code,
    }
}

/// Releases the emergency stop.
pub fn reset(arguments: &Arguments, print: Print) -> ExitCode {
    match ask(&arguments.robot, &Request::Reset) {
        Ok((robot, obeyed)) => {
            let mode = obeyed.after.header.mode().map_or("in an unknown state", Mode::as_str);
            let answer = json!({ "robot": robot, "state": mode, "changed": obeyed.changed });
            print.show(&answer, |_| {
                let done = match obeyed.changed {
                    true => "emergency stop released",
                    false => "no emergency stop was latched",
                };
                format!("{robot}: {done}; the robot is {mode}")
            });
            exit(DONE)
        }
        Err(code) => code,
    }
}

/// The robot, and what it made of the request; else what to exit with, told.
pub(super) fn ask(which: &Which, request: &Request) -> Result<(String, Obeyed), ExitCode> {
    let robot = which.choose().map_err(|problem| fail(&problem, BAD_CONFIGURATION))?;
    let obeyed = Desk::join(&robot).map_err(RequestError::from).and_then(|mut desk| desk.ask(request));
    let code = |error: &RequestError| match error {
        RequestError::Bus(_) | RequestError::NoSuchBehavior { .. } => BAD_CONFIGURATION,
        _ => NOT_ARRIVED,
    };
    let obeyed = obeyed.map_err(|error| fail(&error.to_string(), code(&error)))?;
    Ok((robot, obeyed))
}
