//! Behaviors and drivers that are programs of their own: asked what they are before anything is started.

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::BehaviorFactory;
use yamabico_core::driver::Driver;
use yamabico_parameters::{Entry, Problem, Table, Value};

use super::paths::Home;
use crate::process::{DESCRIBE, Description, DriverDescription, converse};

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

/// Asks the program of the behavior `entry` what it is.
pub(crate) fn ask(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn BehaviorFactory>> {
    let told = converse::<Description>(program, DESCRIBE, "").and_then(Description::factory);
    told.map_err(|problem| problems.push(refused(program, entry, "behavior", problem))).ok()
}

/// Asks the program of the device `entry` which driver it is.
pub(crate) fn ask_driver(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn Driver>> {
    let told = converse::<DriverDescription>(program, DESCRIBE, "").and_then(|told| told.driver(program));
    told.map_err(|problem| problems.push(refused(program, entry, "driver of", problem))).ok()
}

fn refused(program: &[String], entry: &Entry, what: &str, problem: String) -> Problem {
    let table = entry.node.as_table();
    let span = table.and_then(|table| table.span_of("exec")).unwrap_or(entry.node.span);
    let whole = program.join(" ");
    Problem::new(span, format!("`{whole}` cannot be the {what} `{}`", entry.key))
        .label(problem)
        .help("name a program that is built against this version, such as `yamabico new` begins")
}
