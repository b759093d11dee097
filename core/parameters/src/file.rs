//! TOML files named by parameters of devices and behaviors, such as worlds and maps.

use schemars::Schema;

use super::document::{Table, parse};
use super::problem::{Problem, Problems, Source, Span};
use super::schema_check::check_table;
use super::shape::Shape;
use crate::ParameterError;

/// Kind of TOML file named by a parameter of a device or a behavior.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Parameter with the path of the file; its schema has `"format": "file"`.
    pub key: &'static str,
    /// Description with its article, such as "a world file".
    pub what: &'static str,
    /// JSON Schema of its content.
    pub schema: fn() -> Schema,
    /// Returns all errors in a table that fits the schema, each with its key, such as `corridor.door[2].at_m`.
    pub rules: fn(&toml::Table) -> Vec<ParameterError>,
}

impl FileKind {
    /// Parses and checks a text; `name` is shown in errors.
    ///
    /// # Errors
    /// All syntax errors, else all violations of the schema, else all violations of the rules.
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

    /// Adds all errors in the tree of source number `source` to `problems`.
    pub fn check(&self, tree: &Table, source: usize, problems: &mut Vec<Problem>) {
        let schema = (self.schema)().to_value();
        let top = Span { source, start: 0, end: 0 };
        let before = problems.len();
        check_table(tree, top, &[Shape::new(&schema)], self.what, problems);
        if problems.len() > before {
            return;
        }
        for ParameterError { key, problem } in (self.rules)(&tree.to_toml(|_| true)) {
            let name = key.rsplit('.').next().unwrap_or(&key).split('[').next().unwrap_or("");
            problems.push(Problem::new(tree.span_of(&key).unwrap_or(top), format!("`{name}` {problem}")));
        }
    }
}
