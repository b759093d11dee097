//! `yamabico new`: a crate to begin a plugin with.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde::Serialize;

use crate::output::{BAD_CONFIGURATION, DONE, Print, exit, fail};

/// What is begun.
#[derive(Subcommand)]
pub enum New {
    /// A behaviour in a program of its own: a crate with a test, and a task that runs it.
    Behavior(Arguments),
}

/// What `new behavior` is told.
#[derive(Args)]
pub struct Arguments {
    /// Its name, kebab-case; also that of the folder.
    name: String,
    /// The folder of Yamabico's sources; without it, looked for from here upwards.
    #[arg(long, value_name = "DIR")]
    repository: Option<PathBuf>,
}

/// What was begun.
#[derive(Serialize)]
struct Begun {
    folder: PathBuf,
    files: Vec<&'static str>,
}

/// The files of a behaviour's crate: name and text.
const BEHAVIOR: [(&str, &str); 4] = [
    ("Cargo.toml", include_str!("../../templates/behavior/Cargo.toml.txt")),
    ("src/main.rs", include_str!("../../templates/behavior/main.rs")),
    ("task.toml", include_str!("../../templates/behavior/task.toml")),
    (".gitignore", "/target\n/out\n"),
];

/// Writes the crate.
pub fn new(what: &New, print: Print) -> ExitCode {
    let New::Behavior(arguments) = what;
    match begin_behavior(arguments) {
        Ok(begun) => {
            print.show(&begun, |begun| {
                let folder = begun.folder.display();
                format!("{folder} begins: cd {folder} && cargo test && cargo build && yamabico run task.toml --live")
            });
            exit(DONE)
        }
        Err(problem) => fail(&problem, BAD_CONFIGURATION),
    }
}

fn begin_behavior(arguments: &Arguments) -> Result<Begun, String> {
    let name = arguments.name.as_str();
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(fits) || name.len() > 32 {
        return Err(format!(
            "`{name}` cannot be a name: 1 to 32 small letters, digits and `-`, a letter first"
        ));
    }
    let repository = match &arguments.repository {
        Some(folder) => is_repository(folder).then(|| folder.clone()),
        None => std::env::current_dir()
            .ok()
            .and_then(|here| here.ancestors().find(|folder| is_repository(folder)).map(Path::to_path_buf)),
    };
    let repository = repository.and_then(|folder| folder.canonicalize().ok());
    let repository =
        repository.ok_or("Yamabico's sources are not here: name their folder with --repository DIR")?;
    let folder = PathBuf::from(name);
    if folder.exists() {
        return Err(format!("{name} exists already: choose another name or another folder"));
    }
    let failed = |path: &Path, error| format!("cannot write {}: {error}", path.display());
    std::fs::create_dir_all(folder.join("src")).map_err(|error| failed(&folder, error))?;
    for (file, text) in BEHAVIOR {
        let text = text.replace("@name@", name).replace("@repository@", &repository.to_string_lossy());
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(|error| failed(&path, error))?;
    }
    // The versions that Yamabico is tested with.
    let lock = folder.join("Cargo.lock");
    std::fs::copy(repository.join("Cargo.lock"), &lock).map_err(|error| failed(&lock, error))?;
    Ok(Begun { folder, files: BEHAVIOR.map(|(file, _)| file).to_vec() })
}

fn is_repository(folder: &Path) -> bool {
    let manifest = std::fs::read_to_string(folder.join("core/Cargo.toml"));
    manifest.is_ok_and(|text| text.contains("name = \"yamabico-core\""))
}
