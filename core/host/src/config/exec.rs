//! Behaviors and drivers that are external programs, which describe themselves before the run starts.

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::BehaviorFactory;
use yamabico_core::driver::Driver;
use yamabico_parameters::{Entry, Problem, Problems, Source, Table, Value, parse};

use super::paths::Home;
use super::read_file::read_text;
use crate::process::{BehaviorDescription, DESCRIBE, DriverDescription, query};

/// Name of a device, and its driver, which is an external program.
pub(crate) type ExternalDriver = (String, Arc<dyn Driver>);

/// Returns the program and its arguments in `exec` of `table`, or an empty list. Paths are made absolute: a program with a
/// `/` in it, and arguments that begin with `./` or `../`.
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

/// Reads the tree of a task file without checking it.
///
/// # Errors
/// The file cannot be read, or is not valid TOML.
pub(crate) fn read_tree(path: &Path) -> Result<Table, String> {
    let text = read_text(path).map_err(|unreadable| unreadable.to_string())?;
    let mut problems = Vec::new();
    parse(&text, 0, &mut problems).ok_or_else(|| rendered(path, &text, problems))
}

/// Gets the description of the behavior `entry` of the task file `path` from its program; `None` if it has none.
pub(crate) fn ask_behavior(entry: &Entry, path: &Path) -> Option<Result<Arc<dyn BehaviorFactory>, String>> {
    let home = Home { source: 0, path, parts: &[] };
    let program = program_of(entry.node.as_table()?, home);
    if program.is_empty() {
        return None;
    }
    let mut problems = Vec::new();
    let text = || std::fs::read_to_string(path).unwrap_or_default();
    Some(ask(&program, entry, &mut problems).ok_or_else(|| rendered(path, &text(), problems)))
}

fn rendered(path: &Path, text: &str, problems: Vec<Problem>) -> String {
    let source = Source { name: path.display().to_string(), text: text.to_owned() };
    Problems { sources: vec![source], problems }.to_string()
}

/// Gets the description of the behavior `entry` from its program.
pub(crate) fn ask(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn BehaviorFactory>> {
    let described =
        query::<BehaviorDescription>(program, DESCRIBE, "").and_then(BehaviorDescription::factory);
    described.map_err(|problem| problems.push(refused(program, entry, "behavior", problem))).ok()
}

/// Gets the description of the driver of the device `entry` from its program.
pub(crate) fn ask_driver(
    program: &[String],
    entry: &Entry,
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn Driver>> {
    let described =
        query::<DriverDescription>(program, DESCRIBE, "").and_then(|description| description.driver(program));
    described.map_err(|problem| problems.push(refused(program, entry, "driver of", problem))).ok()
}

fn refused(program: &[String], entry: &Entry, what: &str, problem: String) -> Problem {
    let table = entry.node.as_table();
    let span = table.and_then(|table| table.span_of("exec")).unwrap_or(entry.node.span);
    let whole = program.join(" ");
    Problem::new(span, format!("`{whole}` cannot be the {what} `{}`", entry.key))
        .label(problem)
        .help("name a program that was built with this version, such as one created by `yamabico new`")
}
