//! TOML files named by parameters of devices and behaviors, such as worlds and maps.

use std::path::Path;

use schemars::Schema;
use serde::de::DeserializeOwned;

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

/// Reason why a file could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be read.
    #[error("file {path} cannot be read: {reason}")]
    Unreadable {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        reason: String,
    },
    /// The content is invalid; all errors with their places.
    #[error("{0}")]
    Invalid(#[from] Problems),
}

impl FileKind {
    /// Reads and checks a file, and converts it to a type with this schema.
    ///
    /// # Errors
    /// The file cannot be read, or its content is invalid.
    pub fn load<T: DeserializeOwned>(&self, path: &Path) -> Result<T, FileError> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Ok(self.parse(&name, &text)?),
            Err(error) => Err(FileError::Unreadable { path: name, reason: error.to_string() }),
        }
    }

    /// Parses and checks a text, and converts it to a type with this schema; `name` is shown in errors.
    ///
    /// # Errors
    /// All errors in the text.
    pub fn parse<T: DeserializeOwned>(&self, name: &str, text: &str) -> Result<T, Problems> {
        self.read(name, text)?.try_into().map_err(|error: toml::de::Error| {
            let source = Source { name: name.to_owned(), text: text.to_owned() };
            let problem = Problem::new(Span { source: 0, start: 0, end: 0 }, error.message());
            Problems { sources: vec![source], problems: vec![problem] }
        })
    }

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
        for error in (self.rules)(&tree.to_toml(|_| true)) {
            let name = error.key.rsplit('.').next().unwrap_or(&error.key).split('[').next().unwrap_or("");
            let subject = if name.is_empty() { self.what.to_owned() } else { format!("`{name}`") };
            let span = tree.span_of(&error.key).unwrap_or(top);
            let problem = Problem::new(span, error.sentence(&subject));
            problems.push(Problem { help: error.remedy.clone(), ..problem });
        }
    }
}
