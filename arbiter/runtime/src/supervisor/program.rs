//! Program that the processes of plugins run.

use std::ffi::OsString;
use std::path::PathBuf;

/// A program that becomes a plugin. It is started with its arguments, the plugin's name, `--guardian` and `--on-death`, and
/// reads its launch configuration from standard input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// Executable.
    pub path: PathBuf,
    /// First arguments.
    pub arguments: Vec<OsString>,
}

impl Program {
    /// The running program itself, even if its file has been replaced since its start, with the argument `plugin`.
    pub fn this() -> Program {
        Program { path: "/proc/self/exe".into(), arguments: vec!["plugin".into()] }
    }
}
