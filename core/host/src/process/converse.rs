//! A question to a program that is a plugin, before it is started for good.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use serde::de::DeserializeOwned;

/// A program that has not described itself by then never will.
const PATIENCE: Duration = Duration::from_secs(10);

/// Its complaints are there so soon after its end.
const SHORTLY: Duration = Duration::from_millis(200);
/// What a program complains of counts up to so many bytes.
const MAX_COMPLAINTS: u64 = 64 * 1024;

/// Starts `program` with `argument`, tells it `words`, and returns what it answers, as JSON.
pub(crate) fn converse<T: DeserializeOwned>(
    program: &[String],
    argument: &str,
    words: &str,
) -> Result<T, String> {
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
            let _ = from.take(MAX_COMPLAINTS).read_to_end(&mut text);
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
