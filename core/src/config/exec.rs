//! Behaviours that are programs of their own: asked what they are before anything is started.

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use super::document::{Entry, Table, Value};
use super::paths::Home;
use super::problem::Problem;
use crate::behavior::BehaviorPlugin;
use crate::plugin::{DESCRIBE, Description};

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
    let told = describe(program).and_then(|text| {
        let told: Result<Description, _> = serde_json::from_str(&text);
        told.map_err(|error| format!("what it says to {DESCRIBE} is no description: {error}"))?.plugin()
    });
    match told {
        Ok(plugin) => Some(plugin),
        Err(problem) => {
            let table = entry.node.as_table();
            let span = table.and_then(|table| table.span_of("exec")).unwrap_or(entry.node.span);
            let whole = program.join(" ");
            problems.push(
                Problem::new(span, format!("`{whole}` cannot be the behaviour `{}`", entry.key))
                    .label(problem)
                    .help("name a program that is built against this version, such as `yamabico new` begins"),
            );
            None
        }
    }
}

fn describe(program: &[String]) -> Result<String, String> {
    let (name, rest) = program.split_first().ok_or("it names no program")?;
    let mut command = Command::new(name);
    command.args(rest).arg(DESCRIBE).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().map_err(|error| format!("it cannot be started: {error}"))?;
    let (tell, told) = channel();
    if let Some(mut out) = child.stdout.take() {
        std::thread::spawn(move || {
            let mut text = String::new();
            let read = out.read_to_string(&mut text);
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
        Err(_) => Err(format!("it does not answer {DESCRIBE} within {} s", PATIENCE.as_secs())),
    }
}
