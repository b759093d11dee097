//! `yamabico new`: a behavior or a driver to start from, or a building to drive in.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde::Serialize;
use yamabico::building::{WITH_MAP, find_repository, write};
use yamabico_sim::building::{Building, Properties};

use crate::output::{CommandResult, DONE, Failure, Print};

/// Maximum length of a name.
const MAX_NAME: usize = 32;

/// The kind of thing to create.
#[derive(Subcommand)]
pub enum New {
    /// Create a behavior as a program of its own, in Rust or Python, with a test and a task that runs it.
    Behavior(PluginArguments),
    /// Create a driver as a program of its own, in Rust or Python, with a test, a robot and a task that drives it by hand.
    Driver(PluginArguments),
    /// Draw a building from a seed: a simulated hallway with its map, a robot, and a task with the map and one without.
    Building(BuildingArguments),
}

/// Arguments of `new behavior` and `new driver`.
#[derive(Args)]
pub struct PluginArguments {
    /// Name of the plugin and of its folder: lowercase letters, digits and `-`.
    name: String,
    /// Write it in Python instead of Rust.
    #[arg(long)]
    python: bool,
    /// Folder of Yamabico's sources; by default the working directory or one above it, else the folder that this program was
    /// built from.
    #[arg(long, value_name = "DIR")]
    repository: Option<PathBuf>,
}

/// Arguments of `new building`.
#[derive(Args)]
pub struct BuildingArguments {
    /// Seed that the building is drawn from; the same seed gives the same building.
    seed: u64,
    /// Property in place of the one that the seed draws, such as `floor = "mirror"` or `width_m = 1.4`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder to write; by default `building-SEED`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of Yamabico's sources; by default the working directory or one above it, else the folder that this program was
    /// built from.
    #[arg(long, value_name = "DIR")]
    repository: Option<PathBuf>,
}

/// A created building.
#[derive(Serialize)]
struct CreatedBuilding {
    folder: PathBuf,
    files: Vec<&'static str>,
    properties: Properties,
}

/// A created folder.
#[derive(Serialize)]
struct Created {
    folder: PathBuf,
    files: Vec<&'static str>,
    /// Commands that test, build and run it, in that folder.
    run: String,
}

/// The files of a new plugin.
struct Template {
    /// Names and contents.
    files: &'static [(&'static str, &'static str)],
    /// Value of `exec` in the task or the robot.
    exec: &'static str,
    /// Commands that test and build it.
    build: &'static [&'static str],
}

const TASK: (&str, &str) = ("task.toml", include_str!("../../templates/behavior/task.toml"));

const RUST_BEHAVIOR: Template = Template {
    files: &[
        ("Cargo.toml", include_str!("../../templates/behavior/Cargo.toml.txt")),
        ("src/main.rs", include_str!("../../templates/behavior/main.rs")),
        TASK,
        (".gitignore", "/target\n/out\n"),
    ],
    exec: "\"target/debug/@name@\"",
    build: &["cargo test", "cargo build"],
};

const PYTHON_BEHAVIOR: Template = Template {
    files: &[
        ("behavior.py", include_str!("../../templates/python_behavior/behavior.py")),
        ("test_behavior.py", include_str!("../../templates/python_behavior/test_behavior.py")),
        TASK,
        (".gitignore", "/venv\n/out\n__pycache__\n"),
    ],
    exec: "\"venv/bin/python\", \"./behavior.py\"",
    build: &[
        "python3 -m venv venv",
        "venv/bin/pip install @repository@/core/python",
        "venv/bin/python -m unittest",
    ],
};

const DRIVER_TASK: [(&str, &str); 2] = [
    ("robot.toml", include_str!("../../templates/driver/robot.toml")),
    ("task.toml", include_str!("../../templates/driver/task.toml")),
];

const RUST_DRIVER: Template = Template {
    files: &[
        ("Cargo.toml", include_str!("../../templates/driver/Cargo.toml.txt")),
        ("src/main.rs", include_str!("../../templates/driver/main.rs")),
        DRIVER_TASK[0],
        DRIVER_TASK[1],
        (".gitignore", "/target\n/out\n"),
    ],
    ..RUST_BEHAVIOR
};

const PYTHON_DRIVER: Template = Template {
    files: &[
        ("driver.py", include_str!("../../templates/python_driver/driver.py")),
        ("test_driver.py", include_str!("../../templates/python_driver/test_driver.py")),
        DRIVER_TASK[0],
        DRIVER_TASK[1],
        (".gitignore", "/venv\n/out\n__pycache__\n"),
    ],
    exec: "\"venv/bin/python\", \"./driver.py\"",
    ..PYTHON_BEHAVIOR
};

/// Creates it.
pub fn new(new: &New, print: Print) -> CommandResult {
    match new {
        New::Behavior(arguments) => new_plugin(arguments, [RUST_BEHAVIOR, PYTHON_BEHAVIOR], print),
        New::Driver(arguments) => new_plugin(arguments, [RUST_DRIVER, PYTHON_DRIVER], print),
        New::Building(arguments) => new_building(arguments, print),
    }
}

fn new_building(arguments: &BuildingArguments, print: Print) -> CommandResult {
    let created = create_building(arguments).map_err(Failure::usage)?;
    print.show(&created, |created| {
        let properties = toml::to_string(&created.properties).unwrap_or_default();
        let properties = properties.lines().map(|line| format!("  {line}\n"));
        format!(
            "created {folder} with {files}, a building with\n{properties}drive in it:\n  yamabico run {task}",
            folder = created.folder.display(),
            files = created.files.join(", "),
            properties = properties.collect::<String>(),
            task = created.folder.join(WITH_MAP).display()
        )
    });
    Ok(DONE)
}

fn create_building(arguments: &BuildingArguments) -> Result<CreatedBuilding, String> {
    let repository = find_repository(arguments.repository.as_deref())?;
    let building = Building::new(arguments.seed, &arguments.set).map_err(|problems| problems.to_string())?;
    let folder = arguments.out.clone().unwrap_or_else(|| format!("building-{}", arguments.seed).into());
    if folder.exists() {
        return Err(format!("{} already exists: give another folder with --out DIR", folder.display()));
    }
    let files = write(&building, &folder, &repository)?;
    Ok(CreatedBuilding { folder, files, properties: building.properties })
}

/// Creates a plugin from one of the templates for Rust and Python.
fn new_plugin(arguments: &PluginArguments, templates: [Template; 2], print: Print) -> CommandResult {
    let created = create_plugin(arguments, templates).map_err(Failure::usage)?;
    print.show(&created, |created| {
        let files = created.files.iter().map(|file| format!("  {file}\n"));
        format!(
            "created {folder} with\n{files}test, build and run it:\n  cd {folder} && {run}",
            folder = created.folder.display(),
            files = files.collect::<String>(),
            run = created.run
        )
    });
    Ok(DONE)
}

fn create_plugin(arguments: &PluginArguments, [rust, python]: [Template; 2]) -> Result<Created, String> {
    let repository = find_repository(arguments.repository.as_deref())?;
    let name = arguments.name.as_str();
    let is_allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let starts_with_letter = name.starts_with(|c: char| c.is_ascii_lowercase());
    if !starts_with_letter || !name.chars().all(is_allowed) || name.len() > MAX_NAME {
        let similar = valid_name(name).map_or(String::new(), |name| format!("; did you mean `{name}`?"));
        return Err(format!(
            "`{name}` is not a valid name: use 1 to {MAX_NAME} lowercase letters, digits and `-`, beginning with a \
             letter{similar}"
        ));
    }
    let folder = PathBuf::from(name);
    if folder.exists() {
        return Err(format!("{name} already exists here: choose another name, or change to another folder"));
    }
    let failed = |path: &Path, error| format!("cannot write {}: {error}", path.display());
    let template = if arguments.python { python } else { rust };
    let run = [template.build, &["yamabico run task.toml --live"]].concat().join(" && ");
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
        // Pins the versions that Yamabico is tested with.
        let lock = folder.join("Cargo.lock");
        std::fs::copy(repository.join("Cargo.lock"), &lock).map_err(|error| failed(&lock, error))?;
    }
    let run = fill(&run);
    Ok(Created { folder, files: template.files.iter().map(|(file, _)| *file).collect(), run })
}

/// Returns the valid name that is most similar to `name`; `None` without a letter.
fn valid_name(name: &str) -> Option<String> {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let joined = words.collect::<Vec<_>>().join("-").to_ascii_lowercase();
    let start = joined.find(|c: char| c.is_ascii_lowercase())?;
    let end = joined.len().min(start + MAX_NAME);
    Some(joined[start..end].trim_end_matches('-').to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_similar_valid_name_is_suggested() {
        let valid = |name| valid_name(name).unwrap_or_default();
        assert_eq!(valid("My Behavior"), "my-behavior");
        assert_eq!(valid("../2nd_try"), "nd-try");
        assert_eq!(valid(&"a-".repeat(40)).len(), 31);
        assert_eq!(valid_name("42"), None);
    }
}
