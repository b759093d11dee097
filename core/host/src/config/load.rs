//! From files to a checked task.

use std::path::{Path, PathBuf};

use super::overrides::{Change, Overrides};
use super::paths::{Home, tidy, what_is_near};
use super::places::Places;
use super::read_robot::{RobotDraft, read_robot};
use super::read_task::read_task;
use super::task::Task;
use yamabico_core::plugins::Plugins;
use yamabico_parameters::{FileKind, MAX_BYTES, Problem, Problems, Source, Span, Table, parse};

/// Reads a task file and its robot file with the changes of `overrides`, and checks everything that can be checked without
/// opening a device.
///
/// # Errors
/// Everything that is wrong in both files and the overrides, at once.
pub fn load(path: &Path, overrides: &Overrides, plugins: &Plugins) -> Result<Task, Problems> {
    let mut loader = Loader::default();
    let task = loader.load(path, overrides, plugins);
    let Loader { sources, task_tree, robot_tree, problems } = loader;
    let mut problems = Problems { sources, problems };
    problems.sort();
    match task {
        Some(mut task) if problems.is_empty() => {
            task.places = Places { sources: problems.sources, task: task_tree, robot: robot_tree };
            Ok(task)
        }
        _ => Err(problems),
    }
}

#[derive(Default)]
struct Loader {
    sources: Vec<Source>,
    task_tree: Table,
    robot_tree: Table,
    problems: Vec<Problem>,
}

impl Loader {
    fn load(&mut self, path: &Path, overrides: &Overrides, plugins: &Plugins) -> Option<Task> {
        let task_source = self.shelve(path.display().to_string(), String::new());
        let tree = self.read(path, task_source, None);
        let mut for_robot = Vec::new();
        let mut for_task = Vec::new();
        for text in &overrides.set {
            let source = self.shelve("--set".to_owned(), text.clone());
            match Change::parse(text, source, &mut self.problems).map(Change::split_robot) {
                Some(Ok(change)) => for_robot.push(change),
                Some(Err(change)) => for_task.push(change),
                None => {}
            }
        }
        self.task_tree = tree?;
        for change in for_task {
            change.apply(&mut self.task_tree, &mut self.problems);
        }
        let robot = self.robot_draft(path, task_source, overrides, for_robot, plugins);
        let home = Home { source: task_source, path };
        let unfed = self.check_files_of_behaviors(home, plugins);
        read_task(home, &self.task_tree, robot, &unfed, plugins, &mut self.problems)
    }

    fn robot_draft(
        &mut self,
        task_path: &Path,
        task_source: usize,
        overrides: &Overrides,
        changes: Vec<Change>,
        plugins: &Plugins,
    ) -> Option<RobotDraft> {
        let (path, named_at) = self.robot_path(task_path, task_source, overrides)?;
        let source = self.shelve(path.display().to_string(), String::new());
        self.robot_tree = self.read(&path, source, Some(named_at))?;
        for change in changes {
            change.apply(&mut self.robot_tree, &mut self.problems);
        }
        let home = Home { source, path: &path };
        let draft = read_robot(home, &self.robot_tree, plugins, &mut self.problems);
        let devices = self.robot_tree.table("devices");
        let named = draft.devices.iter().filter_map(|device| {
            let table = devices?.table(&device.name)?;
            Some(named_files(table, &device.driver.info().files, home))
        });
        let named: Vec<NamedFile> = named.flatten().collect();
        self.check_files(&named);
        Some(draft)
    }

    /// Checks the files that the tables of behaviors name; the names of the behaviors that name a wrong one.
    fn check_files_of_behaviors(&mut self, home: Home<'_>, plugins: &Plugins) -> Vec<String> {
        let entries = self.task_tree.table("behaviors").map_or(&[][..], |table| table.entries.as_slice());
        let named = entries.iter().filter_map(|entry| {
            let table = entry.node.as_table().filter(|table| table.entry("exec").is_none())?;
            let named = table.entry("type").and_then(|named| named.node.as_text());
            let plugin = plugins.behavior(named.unwrap_or(&entry.key))?;
            Some((entry.key.clone(), named_files(table, &plugin.info().files, home)))
        });
        let named: Vec<(String, Vec<NamedFile>)> = named.collect();
        let mut wrong = Vec::new();
        for (name, files) in named {
            let before = self.problems.len();
            self.check_files(&files);
            if self.problems.len() > before {
                wrong.push(name);
            }
        }
        wrong
    }

    /// Checks files that a table names.
    fn check_files(&mut self, files: &[NamedFile]) {
        for &NamedFile { kind, ref path, span } in files {
            let source = self.shelve(path.display().to_string(), String::new());
            if let Some(tree) = self.read(path, source, Some(span)) {
                kind.check(&tree, source, &mut self.problems);
            }
        }
    }

    /// The robot file's path, and where it is named.
    fn robot_path(
        &mut self,
        task_path: &Path,
        task_source: usize,
        overrides: &Overrides,
    ) -> Option<(PathBuf, Span)> {
        if let Some(path) = &overrides.robot {
            let text = path.display().to_string();
            let span = Span { source: self.sources.len(), start: 0, end: text.len() };
            self.shelve("--robot".to_owned(), text);
            return Some((path.clone(), span));
        }
        let node = &self.task_tree.entry("robot")?.node;
        let named = Path::new(node.as_text()?);
        let folder = match node.span.source == task_source {
            true => task_path.parent().unwrap_or(Path::new("")),
            false => Path::new(""),
        };
        Some((tidy(&folder.join(named)), node.span))
    }

    fn shelve(&mut self, name: String, text: String) -> usize {
        self.sources.push(Source { name, text });
        self.sources.len() - 1
    }

    /// Reads a file into its place among the sources; `named_at` is where its name is written.
    fn read(&mut self, path: &Path, source: usize, named_at: Option<Span>) -> Option<Table> {
        let text = match read_text(path) {
            Ok(text) => text,
            Err(wrong) => {
                let span = named_at.unwrap_or(Span { source, start: 0, end: 0 });
                let problem = Problem::new(span, format!("{}: {}", path.display(), wrong.what));
                let label = if named_at.is_some() { "named here" } else { "cannot be read" };
                self.problems.push(problem.label(label).help(wrong.help));
                return None;
            }
        };
        self.sources[source].text = text;
        parse(&self.sources[source].text, source, &mut self.problems)
    }
}

/// A TOML file that a key of a table names.
struct NamedFile {
    kind: FileKind,
    path: PathBuf,
    span: Span,
}

/// Those of `kinds` that `table`, written in the file `home`, names and that are there; those that are not have been told.
fn named_files(table: &Table, kinds: &[FileKind], home: Home<'_>) -> Vec<NamedFile> {
    let named = kinds.iter().filter_map(|kind| {
        let node = &table.entry(kind.key)?.node;
        let path = home.file(node.as_text()?, node.span);
        path.is_file().then_some(NamedFile { kind: *kind, path, span: node.span })
    });
    named.collect()
}

struct Unreadable {
    what: String,
    help: String,
}

fn read_text(path: &Path) -> Result<String, Unreadable> {
    let wrong = |what: &str, help: &str| Unreadable { what: what.to_owned(), help: help.to_owned() };
    let data = std::fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => wrong("there is no such file", &what_is_near(path)),
        _ => wrong(&error.to_string(), "make it readable for this user"),
    })?;
    if !data.is_file() {
        return Err(wrong("this is not a file", &what_is_near(&path.join("*"))));
    }
    if data.len() > MAX_BYTES as u64 {
        return Err(wrong("the file is larger than 1 MiB", "a configuration is a short TOML text"));
    }
    let bytes =
        std::fs::read(path).map_err(|error| wrong(&error.to_string(), "make it readable for this user"))?;
    String::from_utf8(bytes).map_err(|error| {
        let line =
            error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        wrong(&format!("line {line} is not UTF-8 text"), "save the file as UTF-8; is it a TOML file at all?")
    })
}
