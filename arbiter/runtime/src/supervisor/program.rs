//! The program that plugins' processes run.

use std::ffi::OsString;
use std::path::PathBuf;

/// A program that becomes a plugin: it is started with its arguments, then the plugin's name, `--guardian` and
/// `--on-death`, and serves what standard input charges it with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// The executable.
    pub path: PathBuf,
    /// Its first arguments.
    pub arguments: Vec<OsString>,
}

impl Program {
    /// This very program, even where its file has been replaced since it was started, with the argument `plugin`.
    pub fn this() -> Program {
        Program { path: "/proc/self/exe".into(), arguments: vec!["plugin".into()] }
    }
}
