//! Parameters in TOML, checked against JSON Schemas; all errors are reported at once, each with its source span.
//!
//! ```
//! use yamabico_parameters::FileKind;
//!
//! #[derive(serde::Deserialize, schemars::JsonSchema)]
//! struct Gate {
//!     #[schemars(range(min = 0.05, max = 5.0))]
//!     gate_m: f64,
//! }
//!
//! let schema = || schemars::schema_for!(Gate);
//! let gate = FileKind { key: "gate", what: "a gate file", schema, rules: |_| Vec::new() };
//! assert!(gate.read("gate.toml", "gate_m = 0.5").is_ok());
//! let errors = gate.read("gate.toml", "gate_m = 7").unwrap_err().to_string();
//! assert!(errors.contains("at most 5 m"), "{errors}");
//! ```

mod brackets;
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
pub use file::{FileError, FileKind};
pub use nearest::{instead, nearest, quoted};
pub use problem::{Entry as Mistake, Problem, Problems, Source, Span, Style};
pub use schema_check::check_table;
pub use shape::Shape;
pub use typed::{read, schema_of};
pub use units::{meant, number, unit_of};
