//! Error of a parameter value.

/// Parameter with an invalid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}", if key.is_empty() { String::new() } else { format!("`{key}`: ") })]
pub struct ParameterError {
    /// Dotted key to change; empty for the whole table.
    pub key: String,
    /// Description of the error and its remedy.
    pub problem: String,
}

impl ParameterError {
    /// Creates the error `problem` of `key`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> ParameterError {
        ParameterError { key: key.into(), problem: problem.into() }
    }
}
