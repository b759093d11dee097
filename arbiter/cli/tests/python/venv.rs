//! A Python environment of the tests' own, with the package of this repository.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Where the package is.
pub fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/python").canonicalize().expect("the package")
}

/// The interpreter of an environment beside the program's own folder, made at the first use: `None`, with the reason on
/// standard error, on a machine without a Python of 3.11 or later or without the network to fetch the transport's package from.
pub fn interpreter(program: &Path) -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(|| match make(program) {
        Ok(python) => Some(python),
        Err(reason) => {
            eprintln!("skipped, for want of Python: {reason}");
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
    said(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let constraints = package.join("constraints.txt");
    // What is built is built with the versions of the constraints as well.
    let mut pip = Command::new(&python);
    let pip = pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--editable"]);
    said(pip.arg(&package).arg("--constraint").arg(&constraints).env("PIP_CONSTRAINT", &constraints))?;
    std::fs::write(&done, wanted).map_err(|error| error.to_string())?;
    Ok(python)
}

/// Runs `command`; where it fails, the last line of what it said.
fn said(command: &mut Command) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output().map_err(|error| error.to_string())?;
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = words.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it failed").to_owned();
    if output.status.success() { Ok(()) } else { Err(last) }
}
