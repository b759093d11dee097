//! Behaviours and drivers that are programs of their own: asked what they are before anything is started.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use serde::de::DeserializeOwned;

use super::document::{Entry, Table, Value};
use super::paths::Home;
use super::problem::Problem;
use crate::behavior::{BehaviorPlugin, BuildError};
use crate::plugin::{DESCRIBE, Description, DriverDescription, SENSOR, SensorAnswer, SensorQuestion};
use crate::sensor::{DriverPlugin, SensorInfo, SensorPlugin};

/// A program that has not described itself by then never will.
const PATIENCE: Duration = Duration::from_secs(10);

/// The program and its arguments that `table` names under `exec`, its path made relative to the working directory; empty
/// where it names none.
pub(crate) fn program_of(table: &Table, home: Home<'_>) -> Vec<String> {
    let Some(node) = table.entry("exec").map(|entry| &entry.node) else { return Vec::new() };
    let Value::List(items) = &node.value else { return Vec::new() };
    let mut words: Vec<String> = items.iter().filter_map(|item| item.as_text().map(str::to_owned)).collect();
    if let Some(program) = words.first_mut()
        && program.contains('/')
        && Path::new(program).is_relative()
    {
        let path = home.file(program, node.span);
        *program = std::path::absolute(&path).unwrap_or(path).to_string_lossy().into_owned();
    }
    words
}

/// Asks the program of the behaviour `entry` what it is.
pub(crate) fn ask(program: &[String], entry: &Entry, problems: &mut Vec<Problem>) -> Option<BehaviorPlugin> {
    let told = described::<Description>(program).and_then(Description::plugin);
    told.map_err(|problem| problems.push(refused(program, entry, "behaviour", problem))).ok()
}

/// Asks the program of the device `entry` which driver it is.
pub(crate) fn ask_driver(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<DriverPlugin> {
    let told = described::<DriverDescription>(program).and_then(|told| told.plugin(program));
    told.map_err(|problem| problems.push(refused(program, entry, "driver of", problem))).ok()
}

/// What behaviours are told about a sensor, and the longest list in its messages, bytes; of one that is a program of its own
/// the program is asked.
pub(crate) fn learn(
    driver: &DriverPlugin,
    plugin: &SensorPlugin,
    name: &str,
    table: &toml::Table,
    folder: &Path,
) -> Result<(SensorInfo, usize), BuildError> {
    let Some(told) = driver.told else {
        return Ok(((plugin.describe)(name, table)?, (plugin.most_bytes)(table)?));
    };
    let question = SensorQuestion {
        name: name.to_owned(),
        kind: plugin.kind.to_owned(),
        table: table.clone(),
        folder: folder.to_owned(),
    };
    let failed = |problem: String| BuildError::new("", format!("its driver cannot be asked: {problem}"));
    let text = serde_json::to_string(&question).map_err(|error| failed(error.to_string()))?;
    let answer = converse(&told.program, SENSOR, &text).map_err(failed)?;
    match serde_json::from_str(&answer).map_err(|error| failed(error.to_string()))? {
        SensorAnswer::Sensor { info, .. } if info.message != plugin.message.name => {
            Err(failed(format!("it carries `{}`, not `{}`", info.message, plugin.message.name)))
        }
        SensorAnswer::Sensor { info, most_bytes } => Ok((info, most_bytes)),
        SensorAnswer::Refused { key, problem } => Err(BuildError { key, problem }),
    }
}

fn refused(program: &[String], entry: &Entry, what: &str, problem: String) -> Problem {
    let table = entry.node.as_table();
    let span = table.and_then(|table| table.span_of("exec")).unwrap_or(entry.node.span);
    let whole = program.join(" ");
    Problem::new(span, format!("`{whole}` cannot be the {what} `{}`", entry.key))
        .label(problem)
        .help("name a program that is built against this version, such as `yamabico new` begins")
}

fn described<T: DeserializeOwned>(program: &[String]) -> Result<T, String> {
    let text = converse(program, DESCRIBE, "")?;
    serde_json::from_str(&text)
        .map_err(|error| format!("what it says to {DESCRIBE} is no description: {error}"))
}

/// Starts `program` with `argument`, tells it `words`, and returns what it answers.
fn converse(program: &[String], argument: &str, words: &str) -> Result<String, String> {
    let (name, rest) = program.split_first().ok_or("it names no program")?;
    let mut command = Command::new(name);
    command.args(rest).arg(argument).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().map_err(|error| format!("it cannot be started: {error}"))?;
    let (tell, told) = channel();
    if let Some((mut to, mut from)) = child.stdin.take().zip(child.stdout.take()) {
        let words = words.to_owned();
        std::thread::spawn(move || {
            // Who does not listen may answer all the same.
            let _ = to.write_all(words.as_bytes());
            drop(to);
            let mut text = String::new();
            let read = from.read_to_string(&mut text);
            // Nobody listens any more where it took too long.
            let _ = tell.send(read.map(|_| text));
        });
    }
    let answer = told.recv_timeout(PATIENCE);
    let _ = child.kill();
    let _ = child.wait();
    match answer {
        Ok(Ok(text)) => Ok(text),
        Ok(Err(error)) => Err(format!("what it says cannot be read: {error}")),
        Err(_) => Err(format!("it does not answer {argument} within {} s", PATIENCE.as_secs())),
    }
}
