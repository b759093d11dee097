//! Query of an external plugin's program before it is launched.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use serde::de::DeserializeOwned;

/// Longest time that a program may take to answer.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time between the end of a program and the end of its standard error.
const STDERR_TIMEOUT: Duration = Duration::from_millis(200);
/// Maximum length of standard error that is read, bytes.
const MAX_STDERR_BYTES: u64 = 64 * 1024;

/// Runs `program` with `argument` and `input` on standard input. Returns its standard output, read as JSON.
pub(crate) fn query<T: DeserializeOwned>(
    program: &[String],
    argument: &str,
    input: &str,
) -> Result<T, String> {
    let (name, rest) = program.split_first().ok_or("`exec` names no program")?;
    let mut command = Command::new(name);
    command.args(rest).arg(argument).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("the program cannot be started: {error}"))?;
    let (send_output, output) = channel();
    if let Some((mut stdin, mut stdout)) = child.stdin.take().zip(child.stdout.take()) {
        let input = input.to_owned();
        std::thread::spawn(move || {
            // A program that does not read its input may still answer.
            let _ = stdin.write_all(input.as_bytes());
            drop(stdin);
            let mut text = String::new();
            let read = stdout.read_to_string(&mut text);
            // The receiver is gone after a timeout.
            let _ = send_output.send(read.map(|_| text));
        });
    }
    let (send_errors, errors) = channel();
    if let Some(stderr) = child.stderr.take() {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let _ = stderr.take(MAX_STDERR_BYTES).read_to_end(&mut text);
            let _ = send_errors.send(String::from_utf8_lossy(&text).into_owned());
        });
    }
    let output = output.recv_timeout(TIMEOUT);
    let _ = child.kill();
    let _ = child.wait();
    let problem = match output {
        Ok(Ok(text)) => match serde_json::from_str(&text) {
            Ok(answer) => return Ok(answer),
            Err(error) => format!("the program's answer to {argument} is invalid: {error}"),
        },
        Ok(Err(error)) => format!("the program's answer to {argument} cannot be read: {error}"),
        Err(_) => format!("the program does not answer {argument} within {} s", TIMEOUT.as_secs()),
    };
    let errors = errors.recv_timeout(STDERR_TIMEOUT).unwrap_or_default();
    let last = errors.lines().rfind(|line| !line.trim().is_empty());
    Err(last
        .map_or(problem.clone(), |last| format!("{problem}; its standard error ends with: {}", last.trim())))
}
