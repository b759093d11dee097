//! TOML files that the table of a device or a behavior names, such as worlds and maps, checked like the robot file.

use schemars::Schema;

use super::document::{Table, parse};
use super::problem::{Problem, Problems, Source, Span};
use super::schema_check::check_table;
use super::shape::Shape;
use crate::BuildError;

/// A kind of TOML file that the table of a device or a behavior names.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// The key that names one; its schema says `"format": "file"`.
    pub key: &'static str,
    /// What it is, with its article, such as "a world file".
    pub what: &'static str,
    /// JSON Schema of what stands in it.
    pub schema: fn() -> Schema,
    /// Everything wrong in a table that fits the schema, each at its key, such as `corridor.door[2].at_m`.
    pub rules: fn(&toml::Table) -> Vec<BuildError>,
}

impl FileKind {
    /// Reads and checks a text, called `name` where it is wrong.
    ///
    /// # Errors
    /// Everything that is wrong in it: mistakes of grammar, else those against the schema, else those against the rules.
    pub fn read(&self, name: &str, text: &str) -> Result<toml::Table, Problems> {
        let mut problems = Vec::new();
        let tree = parse(text, 0, &mut problems);
        if let Some(tree) = &tree {
            self.check(tree, 0, &mut problems);
        }
        match tree {
            Some(tree) if problems.is_empty() => Ok(tree.to_toml(|_| true)),
            _ => {
                let source = Source { name: name.to_owned(), text: text.to_owned() };
                let mut problems = Problems { sources: vec![source], problems };
                problems.sort();
                Err(problems)
            }
        }
    }

    /// Adds what is wrong in the tree of source number `source`.
    pub fn check(&self, tree: &Table, source: usize, problems: &mut Vec<Problem>) {
        let schema = (self.schema)().to_value();
        let top = Span { source, start: 0, end: 0 };
        let before = problems.len();
        check_table(tree, top, &[Shape::new(&schema)], self.what, problems);
        if problems.len() > before {
            return;
        }
        for BuildError { key, problem } in (self.rules)(&tree.to_toml(|_| true)) {
            let name = key.rsplit('.').next().unwrap_or(&key).split('[').next().unwrap_or("");
            problems.push(Problem::new(tree.span_of(&key).unwrap_or(top), format!("`{name}` {problem}")));
        }
    }
}
