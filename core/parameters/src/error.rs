//! A parameter that does not fit.

/// A parameter that does not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}", if key.is_empty() { String::new() } else { format!("`{key}`: ") })]
pub struct BuildError {
    /// The key to change, dotted; empty where the whole table.
    pub key: String,
    /// What is wrong and what would be right.
    pub problem: String,
}

impl BuildError {
    /// `key` is wrong because of `problem`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> BuildError {
        BuildError { key: key.into(), problem: problem.into() }
    }
}
