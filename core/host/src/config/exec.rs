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

/// Program that connects robots and behaviors to ROS 2.
const ROS2_PROGRAM: &str = "yamabico-ros2";
/// Keys of a behavior that the program for ROS 2 brings along, and its argument for each.
pub(crate) const ROS2_KEYS: [(&str, &str); 3] =
    [("ros2_twist", "twist"), ("ros2_lock", "lock"), ("ros2_publish", "publish")];
/// Name of the driver that it brings along.
pub(crate) const ROS2_DRIVER: &str = "ros2";

/// Returns the program and its arguments in `exec` of `table`, or those that a key or the driver stands for, or an empty list.
/// Paths are made absolute: a program with a `/` in it, and arguments that begin with `./` or `../`.
pub(crate) fn program_of(table: &Table, home: Home<'_>) -> Vec<String> {
    let Some(node) = table.entry("exec").map(|entry| &entry.node) else {
        return ros2_argument(table)
            .map_or_else(Vec::new, |argument| vec![ros2_program(), argument.to_owned()]);
    };
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

/// Returns the program that the key of a behavior or a device stands for, in place of `exec`: its name, and its argument.
#[must_use]
pub fn program_for(key: &str, value: &str) -> Option<[&'static str; 2]> {
    let of_key = ROS2_KEYS.into_iter().find(|(name, _)| *name == key).map(|(_, argument)| argument);
    let argument = of_key.or_else(|| (key == "driver" && value == ROS2_DRIVER).then_some("driver"))?;
    Some([ROS2_PROGRAM, argument])
}

/// Returns the argument of the program for ROS 2 if the table is of one of its behaviors or devices.
fn ros2_argument(table: &Table) -> Option<&'static str> {
    let named = |entry: &Entry| program_for(&entry.key, entry.node.as_text().unwrap_or_default());
    table.entries.iter().find_map(named).map(|[_, argument]| argument)
}

/// Path of the program for ROS 2: beside this program, or its name, which is then looked for in PATH.
fn ros2_program() -> String {
    let own = std::env::current_exe().ok();
    let beside = own.and_then(|own| Some(own.parent()?.join(ROS2_PROGRAM))).filter(|path| path.is_file());
    beside.map_or_else(|| ROS2_PROGRAM.to_owned(), |path| path.to_string_lossy().into_owned())
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
    let is_ros2 = table.is_some_and(|table| table.entry("exec").is_none());
    let span = table.and_then(|table| table.span_of("exec")).unwrap_or(entry.node.span);
    let whole = program.join(" ");
    let help = match is_ros2 {
        true => "install the program for ROS 2: cargo install --path sensors/ros2 --features dds",
        false => "name a program that was built with this version, such as one created by `yamabico new`",
    };
    Problem::new(span, format!("`{whole}` cannot be the {what} `{}`", entry.key)).label(problem).help(help)
}
