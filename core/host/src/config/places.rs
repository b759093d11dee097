//! Where everything of a loaded task was written, for problems that show up later.

use super::task::Task;
use yamabico_core::behavior::BuildError;
use yamabico_parameters::{Problem, Problems, Source, Span, Table};

/// The sources and trees of a loaded task.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pub sources: Vec<Source>,
    pub task: Table,
    pub robot: Table,
}

/// A part of a configuration that can turn out not to fit when it is built or opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part<'a> {
    /// A behavior, by its name in the task file.
    Behavior(&'a str),
    /// A device, by its name in the robot file.
    Device(&'a str),
    /// A sensor, by its name in the robot file.
    Sensor(&'a str),
    /// The drive.
    Drive,
}

impl Task {
    /// The refusal `error` of a part, with a pointer to the key that it names.
    pub fn explain(&self, part: Part<'_>, error: &BuildError) -> Problems {
        let found = match part {
            Part::Behavior(name) => entry(&self.places.task, "behaviors", name),
            Part::Device(name) => entry(&self.places.robot, "devices", name),
            Part::Sensor(name) => entry(&self.places.robot, "sensors", name),
            Part::Drive => self.places.robot.entry("drive"),
        };
        let problem = match found {
            Some(found) => refusal(found, error),
            None => Problem::new(Span::default(), error.to_string()),
        };
        Problems { sources: self.places.sources.clone(), problems: vec![problem] }
    }
}

fn entry<'a>(root: &'a Table, group: &str, name: &str) -> Option<&'a yamabico_parameters::Entry> {
    root.table(group)?.entry(name)
}

/// The refusal of the part that `entry` describes.
pub(crate) fn refusal(entry: &yamabico_parameters::Entry, error: &BuildError) -> Problem {
    let inside = entry.node.as_table().and_then(|table| table.span_of(&error.key));
    let what = if error.key.is_empty() { entry.key.clone() } else { error.key.clone() };
    Problem::new(inside.unwrap_or(entry.node.span), format!("`{what}`: {}", error.problem))
        .label(format!("refused by `{}`", entry.key))
}
