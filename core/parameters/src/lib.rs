//! Parameters in TOML, checked against JSON Schemas; all errors are reported at once, each with its source span.

mod document;
mod error;
mod excerpt;
mod file;
mod grammar;
mod nearest;
mod problem;
mod schema_check;
mod shape;
mod typed;
mod units;

pub use document::{Entry, MAX_BYTES, Node, Table, Value, parse};
pub use error::ParameterError;
pub use file::FileKind;
pub use nearest::{instead, nearest, quoted};
pub use problem::{Entry as Mistake, Problem, Problems, Source, Span, Style};
pub use schema_check::check_table;
pub use shape::Shape;
pub use typed::{read, schema_of};
pub use units::{meant, number, unit_of};
