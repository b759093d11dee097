//! Workers that carry out the commands for a running robot.

use std::path::Path;
use std::sync::mpsc::Receiver;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use serde_json::Value as Json;
use toml::{Table, Value};
use yamabico_core::message::Mode;
use yamabico_runtime::client::{ClientError, GoalRequest, Request, RobotClient};

use super::command::{Answer, Command, Job};
use crate::recent::{KEPT, Recent, file_name};

/// Distance from a goal at which it is reached, m.
const GOAL_TOLERANCE_M: f64 = 0.3;

/// Carries out emergency stops, until the server ends. The robot is joined beforehand.
pub(super) fn stop(robot: &str, jobs: &Receiver<Job>) {
    let mut client = RobotClient::join(robot).ok();
    while let Ok(job) = jobs.recv() {
        let joined = client.as_mut().map(|client| client.request(&Request::EmergencyStop));
        let result = match joined {
            Some(Ok(result)) => Ok(result),
            // The robot may have been restarted since.
            _ => RobotClient::join(robot).and_then(|joined| {
                let client = client.insert(joined);
                client.request(&Request::EmergencyStop)
            }),
        };
        let answer = result.map(|result| format!("stopped after {:.2} s", result.took.as_secs_f64()));
        // Sending fails only if the client has gone.
        let _ = job.answer.send(answer.map_err(|error| error.to_string()));
    }
}

/// Carries out all other commands, one after the other, until the server ends.
pub(super) fn operate(robot: &str, recent: &Mutex<Recent>, folder: &Path, jobs: &Receiver<Job>) {
    while let Ok(job) = jobs.recv() {
        let answer = match job.command {
            Command::Save => save(robot, recent, folder),
            command => carry_out(robot, command).map_err(|error| error.to_string()),
        };
        let _ = job.answer.send(answer);
    }
}

fn carry_out(robot: &str, command: Command) -> Result<String, ClientError> {
    let mut client = RobotClient::join(robot)?;
    match command {
        Command::Estop => client.request(&Request::EmergencyStop).map(|_| "stopped".to_owned()),
        Command::Reset => {
            let mode = client.request(&Request::Reset)?.after.header.mode();
            Ok(format!("emergency stop released; mode: {}", mode.map_or("unknown", Mode::as_str)))
        }
        Command::Enable { behavior } => {
            client.request(&Request::Enable(behavior.clone()))?;
            Ok(format!("{behavior} is enabled"))
        }
        Command::Disable { behavior } => {
            client.request(&Request::Disable(behavior.clone()))?;
            Ok(format!("{behavior} is disabled"))
        }
        Command::Goto { x_m, y_m } => {
            let goal = GoalRequest { x_m, y_m, heading_rad: None, tolerance_m: GOAL_TOLERANCE_M };
            let progress = client.goal_progress(None)?;
            let to_go_m = client.send_goal(&goal, &progress)?;
            Ok(format!("driving {to_go_m:.1} m to ({x_m:.2}, {y_m:.2})"))
        }
        Command::Set { behavior, key, value } => {
            let took = client.set_parameters(&assignment(&behavior, &key, value.clone()))?;
            Ok(format!("{behavior}.{key} = {value} in effect after {:.2} s", took.as_secs_f64()))
        }
        Command::Save
        | Command::Play { .. }
        | Command::Pause
        | Command::Seek { .. }
        | Command::Jump { .. } => Ok(String::new()),
    }
}

fn save(robot: &str, recent: &Mutex<Recent>, folder: &Path) -> Answer {
    // The copy shares the messages, so that reading from the robot goes on meanwhile.
    let recent = recent.lock().unwrap_or_else(PoisonError::into_inner).clone();
    if recent.is_empty() {
        return Err("nothing was received yet".to_owned());
    }
    let path = folder.join(file_name(robot, SystemTime::now()));
    let bytes = recent.save(&path)?;
    let seconds = KEPT.as_secs();
    Ok(format!("saved the last {seconds} s to {} ({:.1} MB)", path.display(), bytes as f64 * 1e-6))
}

/// Table of a parameter change.
fn assignment(behavior: &str, key: &str, value: Json) -> Table {
    let parts = std::iter::once(behavior).chain(key.split('.'));
    let last = to_toml(value);
    let nested =
        parts.rev().fold(last, |value, key| Value::Table(Table::from_iter([(key.to_owned(), value)])));
    match nested {
        Value::Table(table) => table,
        _ => Table::new(),
    }
}

/// Converts a value; TOML has no null, which becomes an empty text that the schema refuses.
fn to_toml(value: Json) -> Value {
    match value {
        Json::Null => Value::String(String::new()),
        Json::Bool(value) => Value::Boolean(value),
        Json::Number(number) => match number.as_i64() {
            Some(integer) => Value::Integer(integer),
            None => Value::Float(number.as_f64().unwrap_or(f64::NAN)),
        },
        Json::String(text) => Value::String(text),
        Json::Array(items) => Value::Array(items.into_iter().map(to_toml).collect()),
        Json::Object(fields) => {
            Value::Table(fields.into_iter().map(|(key, value)| (key, to_toml(value))).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_dotted_key_is_a_nested_table() {
        let text = toml::to_string(&assignment("wall-follower", "gate.min_m", json!(0.5))).unwrap();
        assert_eq!(text, "[wall-follower.gate]\nmin_m = 0.5\n");
        let text = toml::to_string(&assignment("a", "route", json!([[1, 2.5]]))).unwrap();
        assert_eq!(text, "[a]\nroute = [[1, 2.5]]\n");
        assert!(toml::to_string(&assignment("a", "b", Json::Null)).is_ok());
    }
}
