//! A Python environment for tests, with the package of this repository.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Returns the folder of the package.
///
/// # Panics
/// If it does not exist.
pub fn package() -> PathBuf {
    yamabico_testkit::workspace().join("core/python").canonicalize().expect("the package")
}

/// Returns the interpreter of an environment beside the folder of `program`, created at the first use. Prints the reason and returns `None`
/// without Python 3.11 or later, or without a network to install the package `iceoryx2`.
pub fn interpreter(program: &Path) -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(|| match make(program) {
        Ok(python) => Some(python),
        Err(reason) => {
            eprintln!("skipped, no Python environment: {reason}");
            None
        }
    });
    made.clone()
}

fn make(program: &Path) -> Result<PathBuf, String> {
    let target = program.parent().and_then(Path::parent).ok_or("no target folder")?;
    let folder = target.join("python-venv");
    let (python, done) = (folder.join("bin/python"), folder.join("yamabico-installed"));
    let package = package();
    let files = ["pyproject.toml", "constraints.txt"].map(|file| std::fs::read_to_string(package.join(file)));
    let files = files.into_iter().collect::<Result<String, _>>().map_err(|error| error.to_string())?;
    let wanted = format!("{}\n{files}", package.display());
    if std::fs::read_to_string(&done).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let constraints = package.join("constraints.txt");
    // The constraints apply to build dependencies too.
    let mut pip = Command::new(&python);
    let pip = pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--editable"]);
    run(pip.arg(&package).arg("--constraint").arg(&constraints).env("PIP_CONSTRAINT", &constraints))?;
    std::fs::write(&done, wanted).map_err(|error| error.to_string())?;
    Ok(python)
}

/// Runs `command`; returns the last line of its error output if it fails.
fn run(command: &mut Command) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output().map_err(|error| error.to_string())?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it failed").to_owned();
    if output.status.success() { Ok(()) } else { Err(last) }
}
