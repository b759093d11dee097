//! Source spans of a loaded task, for errors detected later.

use super::task::Task;
use yamabico_core::behavior::ParameterError;
use yamabico_parameters::{Problem, Problems, Source, Span, Table};

/// Source texts and trees of a loaded task.
#[derive(Clone, Debug, Default)]
pub(crate) struct SourceMap {
    pub sources: Vec<Source>,
    pub task: Table,
    pub robot: Table,
}

/// Part of a configuration that can be refused when it is built or opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part<'a> {
    /// Behavior, by its name in the task file.
    Behavior(&'a str),
    /// Device, by its name in the robot file.
    Device(&'a str),
    /// Sensor, by its name in the robot file.
    Sensor(&'a str),
    /// Drive.
    Drive,
}

impl Task {
    /// Returns the error of a part with the span of its key.
    pub fn explain(&self, part: Part<'_>, error: &ParameterError) -> Problems {
        let found = match part {
            Part::Behavior(name) => entry(&self.source_map.task, "behaviors", name),
            Part::Device(name) => entry(&self.source_map.robot, "devices", name),
            Part::Sensor(name) => entry(&self.source_map.robot, "sensors", name),
            Part::Drive => self.source_map.robot.entry("drive"),
        };
        let problem = match found {
            Some(found) => refusal(found, error),
            None => Problem::new(Span::default(), error.to_string()),
        };
        Problems { sources: self.source_map.sources.clone(), problems: vec![problem] }
    }
}

fn entry<'a>(root: &'a Table, group: &str, name: &str) -> Option<&'a yamabico_parameters::Entry> {
    root.table(group)?.entry(name)
}

/// Returns the error of the part described by `entry`, with the span of its key.
pub(crate) fn refusal(entry: &yamabico_parameters::Entry, error: &ParameterError) -> Problem {
    let inside = entry.node.as_table().and_then(|table| table.span_of(&error.key));
    let what = if error.key.is_empty() { &entry.key } else { &error.key };
    let problem = Problem::new(inside.unwrap_or(entry.node.span), error.sentence(&format!("`{what}`")))
        .label(format!("refused by `{}`", entry.key));
    Problem { help: error.remedy.clone(), ..problem }
}
