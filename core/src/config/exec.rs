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

/// Its complaints are there so soon after its end.
const SHORTLY: Duration = Duration::from_millis(200);
/// What a program complains of counts up to so many bytes.
const MOST_COMPLAINTS: u64 = 64 * 1024;

/// The program and its arguments that `table` names under `exec`, paths made absolute: of the program whatever has a `/` in it,
/// of the arguments what begins with `./` or `../`. Empty where it names none.
pub(crate) fn program_of(table: &Table, home: Home<'_>) -> Vec<String> {
    let Some(node) = table.entry("exec").map(|entry| &entry.node) else { return Vec::new() };
    let Value::List(items) = &node.value else { return Vec::new() };
    let words = items.iter().filter_map(|item| item.as_text()).enumerate().map(|(place, word)| {
        let is_path =
            if place == 0 { word.contains('/') } else { word.starts_with("./") || word.starts_with("../") };
        if !is_path || Path::new(word).is_absolute() {
            return word.to_owned();
        }
        let path = home.file(word, node.span);
        std::path::absolute(&path).unwrap_or(path).to_string_lossy().into_owned()
    });
    words.collect()
}

/// Asks the program of the behaviour `entry` what it is.
pub(crate) fn ask(program: &[String], entry: &Entry, problems: &mut Vec<Problem>) -> Option<BehaviorPlugin> {
    let told = converse::<Description>(program, DESCRIBE, "").and_then(Description::plugin);
    told.map_err(|problem| problems.push(refused(program, entry, "behaviour", problem))).ok()
}

/// Asks the program of the device `entry` which driver it is.
pub(crate) fn ask_driver(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<DriverPlugin> {
    let told = converse::<DriverDescription>(program, DESCRIBE, "").and_then(|told| told.plugin(program));
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
    match converse(&told.program, SENSOR, &text).map_err(failed)? {
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

/// Starts `program` with `argument`, tells it `words`, and returns what it answers, as JSON.
fn converse<T: DeserializeOwned>(program: &[String], argument: &str, words: &str) -> Result<T, String> {
    let (name, rest) = program.split_first().ok_or("it names no program")?;
    let mut command = Command::new(name);
    command.args(rest).arg(argument).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
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
    let (complain, complained) = channel();
    if let Some(from) = child.stderr.take() {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let _ = from.take(MOST_COMPLAINTS).read_to_end(&mut text);
            let _ = complain.send(String::from_utf8_lossy(&text).into_owned());
        });
    }
    let answer = told.recv_timeout(PATIENCE);
    let _ = child.kill();
    let _ = child.wait();
    let problem = match answer {
        Ok(Ok(text)) => match serde_json::from_str(&text) {
            Ok(answer) => return Ok(answer),
            Err(error) => format!("what it answers to {argument} is not what is asked for: {error}"),
        },
        Ok(Err(error)) => format!("what it says cannot be read: {error}"),
        Err(_) => format!("it does not answer {argument} within {} s", PATIENCE.as_secs()),
    };
    let complaints = complained.recv_timeout(SHORTLY).unwrap_or_default();
    let last = complaints.lines().rfind(|line| !line.trim().is_empty());
    Err(last.map_or(problem.clone(), |last| format!("{problem}; it complains: {}", last.trim())))
}
