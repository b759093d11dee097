//! The program under test: its command line, its output, and a folder for its files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for a run to get going.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// The program.
pub fn binary() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_yamabico"))
}

/// A call of the program, without colors and without standard input.
pub fn yamabico() -> Command {
    let mut command = Command::new(binary());
    command.env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

/// Everything that was printed.
pub fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Asserts the exit code, and that the printed text contains each of `parts`.
pub fn assert_exit(output: &Output, code: i32, parts: &[&str]) {
    let text = text(output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in {text}");
    }
}

/// Waits until `condition` holds; panics with `problem` if it does not in time.
pub fn await_true(problem: &str, condition: impl Fn() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(begun.elapsed() < TIMEOUT, "{problem}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Builds an example of the workspace in the profile of the program, and returns its path. With the features of the whole
/// workspace, since a selection of packages would build all dependencies once more.
pub fn example(name: &str) -> PathBuf {
    let target = binary().parent().unwrap();
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "--offline", "--workspace", "--example", name]);
    if target.ends_with("release") {
        build.arg("--release");
    }
    assert!(build.status().unwrap().success());
    target.join("examples").join(name)
}

/// A temporary folder, removed when dropped.
pub struct TestFolder(PathBuf);

impl TestFolder {
    /// Creates the folder of a test.
    pub fn new(test: &str) -> TestFolder {
        let folder = std::env::temp_dir().join(format!("yamabico-cli-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        TestFolder(folder)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// A file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
