//! `yamabico new`: a crate to begin a plugin with.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde::Serialize;

use crate::output::{BAD_CONFIGURATION, DONE, Print, exit, fail};

/// What is begun.
#[derive(Subcommand)]
pub enum New {
    /// A behavior in a program of its own, in Rust or in Python, with a test, and a task that runs it.
    Behavior(Arguments),
}

/// What `new behavior` is told.
#[derive(Args)]
pub struct Arguments {
    /// Its name, kebab-case; also that of the folder.
    name: String,
    /// In Python, instead of a crate in Rust.
    #[arg(long)]
    python: bool,
    /// The folder of Yamabico's sources; without it, looked for from here upwards.
    #[arg(long, value_name = "DIR")]
    repository: Option<PathBuf>,
}

/// What was begun.
#[derive(Serialize)]
struct Begun {
    folder: PathBuf,
    files: Vec<&'static str>,
    /// What runs it, in that folder.
    run: String,
}

/// What a behavior begins with.
struct Template {
    /// Names and texts.
    files: &'static [(&'static str, &'static str)],
    /// How its task names the program.
    exec: &'static str,
    /// What tests it and makes it ready to run.
    ready: &'static [&'static str],
}

const TASK: (&str, &str) = ("task.toml", include_str!("../../templates/behavior/task.toml"));

const RUST: Template = Template {
    files: &[
        ("Cargo.toml", include_str!("../../templates/behavior/Cargo.toml.txt")),
        ("src/main.rs", include_str!("../../templates/behavior/main.rs")),
        TASK,
        (".gitignore", "/target\n/out\n"),
    ],
    exec: "\"target/debug/@name@\"",
    ready: &["cargo test", "cargo build"],
};

const PYTHON: Template = Template {
    files: &[
        ("behavior.py", include_str!("../../templates/python_behavior/behavior.py")),
        ("test_behavior.py", include_str!("../../templates/python_behavior/test_behavior.py")),
        TASK,
        (".gitignore", "/venv\n/out\n__pycache__\n"),
    ],
    exec: "\"venv/bin/python\", \"./behavior.py\"",
    ready: &[
        "python3 -m venv venv",
        "venv/bin/pip install @repository@/core/python",
        "venv/bin/python -m unittest",
    ],
};

/// Writes the folder.
pub fn new(what: &New, print: Print) -> ExitCode {
    let New::Behavior(arguments) = what;
    match begin_behavior(arguments) {
        Ok(begun) => {
            print.show(&begun, |begun| {
                format!(
                    "{folder} begins: cd {folder} && {run}",
                    folder = begun.folder.display(),
                    run = begun.run
                )
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
    let template = if arguments.python { PYTHON } else { RUST };
    let run = [template.ready, &["yamabico run task.toml --live"]].concat().join(" && ");
    let fill = |text: &str| {
        let text = text.replace("@run@", &run).replace("@exec@", template.exec);
        text.replace("@name@", name).replace("@repository@", &repository.to_string_lossy())
    };
    for (file, text) in template.files {
        let path = folder.join(file);
        let parent = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        parent.and_then(|()| std::fs::write(&path, fill(text))).map_err(|error| failed(&path, error))?;
    }
    if !arguments.python {
        // The versions that Yamabico is tested with.
        let lock = folder.join("Cargo.lock");
        std::fs::copy(repository.join("Cargo.lock"), &lock).map_err(|error| failed(&lock, error))?;
    }
    let run = fill(&run);
    Ok(Begun { folder, files: template.files.iter().map(|(file, _)| *file).collect(), run })
}

fn is_repository(folder: &Path) -> bool {
    let manifest = std::fs::read_to_string(folder.join("core/Cargo.toml"));
    manifest.is_ok_and(|text| text.contains("name = \"yamabico-core\""))
}
