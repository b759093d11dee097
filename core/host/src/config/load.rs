//! Loading of a task from its files.

use std::path::{Path, PathBuf};

use super::checks::{check_goal, check_watchdog, extent_m, find_too_fast, report_too_fast};
use super::exec::{ExternalDriver, ask_driver, program_of};
use super::overrides::{Change, Overrides};
use super::paths::{Home, tidy};
use super::read_file::read_text;
use super::read_robot::{RobotDraft, read_robot};
use super::read_task::{NamedFiles, read_task};
use super::source_map::SourceMap;
use super::task::Task;
use yamabico_core::plugins::Plugins;
use yamabico_parameters::{FileKind, Problem, Problems, Source, Span, Table, Value, parse};

/// Reads a task file and its robot file with the changes of `overrides`, and checks them without opening a device.
///
/// # Errors
/// All errors in both files and the overrides.
pub fn load(path: &Path, overrides: &Overrides, plugins: &Plugins) -> Result<Task, Problems> {
    let mut loader = Loader::default();
    let task = loader.load(path, overrides, plugins);
    let Loader { sources, task_tree, robot_tree, problems, .. } = loader;
    let mut problems = Problems { sources, problems };
    problems.sort();
    match task {
        Some(mut task) if problems.is_empty() => {
            task.source_map = SourceMap { sources: problems.sources, task: task_tree, robot: robot_tree };
            Ok(task)
        }
        _ => Err(problems),
    }
}

/// Gets the drivers in the robot file `path` that are external programs.
///
/// # Errors
/// A file cannot be read, is not valid TOML or no robot file, or a program does not describe itself.
pub(crate) fn external_drivers(path: &Path) -> Result<Vec<ExternalDriver>, Problems> {
    let mut loader = Loader::default();
    let source = loader.shelve(path.display().to_string(), String::new());
    loader.robot_tree = loader.read(path, source, None).unwrap_or_default();
    if role(&loader.robot_tree) == Role::Task {
        let top = Span { source, start: 0, end: 0 };
        loader.problems.push(
            Problem::new(top, "this is a task file, not a robot file")
                .label("a robot file has the tables [devices], [sensors] and [drive]")
                .help("name a robot file"),
        );
    }
    loader.include_parts(path, source);
    let Loader { sources, robot_tree, mut problems, parts, .. } = loader;
    let home = Home { source, path, parts: &parts };
    let mut drivers = Vec::new();
    for entry in robot_tree.table("devices").map_or(&[][..], |devices| devices.entries.as_slice()) {
        let program = entry.node.as_table().map_or_else(Vec::new, |table| program_of(table, home));
        if !program.is_empty() {
            drivers
                .extend(ask_driver(&program, entry, &mut problems).map(|driver| (entry.key.clone(), driver)));
        }
    }
    if problems.is_empty() { Ok(drivers) } else { Err(Problems { sources, problems }) }
}

#[derive(Default)]
struct Loader {
    sources: Vec<Source>,
    task_tree: Table,
    robot_tree: Table,
    problems: Vec<Problem>,
    /// Folders of the parts that the robot file includes, by source.
    parts: Vec<(usize, PathBuf)>,
    /// Maximum absolute coordinate or length in the files that devices and behaviors name, m.
    extent_m: f64,
}

/// Role of a file, guessed from its keys.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    Task,
    Robot,
    Unknown,
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
        if role(&self.task_tree) == Role::Robot {
            let top = Span { source: task_source, start: 0, end: 0 };
            self.problems.push(
                Problem::new(top, "this is a robot file, not a task file")
                    .label("a task file has a table [behaviors]")
                    .help("name a task file, and change its robot with --robot FILE"),
            );
            return None;
        }
        for change in for_task {
            change.apply(&mut self.task_tree, &mut self.problems);
        }
        let robot = self.robot_draft(path, task_source, overrides, for_robot, plugins);
        let home = Home { source: task_source, path, parts: &[] };
        let mut refused = self.check_files_of_behaviors(home, plugins);
        let mut too_fast = Vec::new();
        if let Some(robot) = &robot {
            check_watchdog(&self.task_tree, &self.robot_tree, robot, &mut self.problems);
            too_fast = find_too_fast(&self.task_tree, &self.robot_tree, robot);
            refused.extend(too_fast.iter().map(|speed| speed.behavior.clone()));
        }
        let named_at = self.task_tree.entry("robot").map(|entry| entry.node.span.source);
        let has_another_robot = overrides.robot.is_some() || named_at.is_some_and(|at| at != task_source);
        let files = NamedFiles { refused, extent_m: self.extent_m, has_another_robot };
        let task = read_task(home, &self.task_tree, robot, &files, plugins, &mut self.problems);
        report_too_fast(too_fast, &mut self.problems);
        check_goal(&self.task_tree, self.extent_m, &mut self.problems);
        task
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
        if role(&self.robot_tree) == Role::Task {
            let top = Span { source, start: 0, end: 0 };
            self.problems.push(
                Problem::new(named_at, format!("{} is a task file, not a robot file", path.display()))
                    .label("named as the robot here")
                    .also(top, "a robot file has the tables [devices], [sensors] and [drive]")
                    .help("name a robot file"),
            );
            return None;
        }
        self.include_parts(&path, source);
        for change in changes {
            change.apply(&mut self.robot_tree, &mut self.problems);
        }
        let parts = std::mem::take(&mut self.parts);
        let home = Home { source, path: &path, parts: &parts };
        let mut draft = read_robot(home, &self.robot_tree, plugins, &mut self.problems);
        draft.parts = parts.iter().map(|(source, _)| PathBuf::from(&self.sources[*source].name)).collect();
        let devices = self.robot_tree.table("devices");
        let named = draft.devices.iter().filter_map(|device| {
            let table = devices?.table(&device.name)?;
            Some(named_files(table, &device.driver.info().files, home))
        });
        let named: Vec<NamedFile> = named.flatten().collect();
        self.check_files(&named);
        Some(draft)
    }

    /// Checks the files named by behaviors; returns the names of the behaviors that name an invalid file.
    fn check_files_of_behaviors(&mut self, home: Home<'_>, plugins: &Plugins) -> Vec<String> {
        let entries = self.task_tree.table("behaviors").map_or(&[][..], |table| table.entries.as_slice());
        let named = entries.iter().filter_map(|entry| {
            let table = entry.node.as_table().filter(|table| program_of(table, home).is_empty())?;
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

    /// Checks files named by a table.
    fn check_files(&mut self, files: &[NamedFile]) {
        for &NamedFile { kind, ref path, span } in files {
            let source = self.shelve(path.display().to_string(), String::new());
            if let Some(tree) = self.read(path, source, Some(span)) {
                self.extent_m = self.extent_m.max(extent_m(&tree));
                kind.check(&tree, source, &mut self.problems);
            }
        }
    }

    /// Returns the path of the robot file and the span that names it.
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

    /// Merges the files that `include` of the robot file names into its tree.
    fn include_parts(&mut self, robot_path: &Path, robot_source: usize) {
        let Some(entry) = self.robot_tree.entry("include") else { return };
        let Value::List(items) = &entry.node.value else { return };
        let named: Vec<(String, Span)> =
            items.iter().filter_map(|item| Some((item.as_text()?.to_owned(), item.span))).collect();
        for (text, span) in named {
            let home = Home { source: robot_source, path: robot_path, parts: &[] };
            let path = home.file(&text, span);
            let source = self.shelve(path.display().to_string(), String::new());
            let Some(part) = self.read(&path, source, Some(span)) else { continue };
            if let Some(nested) = part.entry("include") {
                self.problems.push(
                    Problem::new(nested.key_span, "an included file must not include others")
                        .label("not allowed here")
                        .also(span, "included here")
                        .help("include both files in the robot file"),
                );
                continue;
            }
            self.parts.push((source, path.parent().map(PathBuf::from).unwrap_or_default()));
            merge_part(&mut self.robot_tree, part, "", &mut self.problems);
        }
    }

    fn shelve(&mut self, name: String, text: String) -> usize {
        self.sources.push(Source { name, text });
        self.sources.len() - 1
    }

    /// Reads and parses a file into source number `source`; `named_at` is the span that names it.
    fn read(&mut self, path: &Path, source: usize, named_at: Option<Span>) -> Option<Table> {
        match read_text(path) {
            Ok(text) => {
                self.sources[source].text = text;
                parse(&self.sources[source].text, source, &mut self.problems)
            }
            Err(unreadable) => {
                self.problems.push(unreadable.problem(&mut self.sources[source], source, named_at));
                None
            }
        }
    }
}

/// TOML file named by a key of a table.
struct NamedFile {
    kind: FileKind,
    path: PathBuf,
    span: Span,
}

/// Returns the existing files of `kinds` that `table` in the file `home` names; missing files are already reported.
fn named_files(table: &Table, kinds: &[FileKind], home: Home<'_>) -> Vec<NamedFile> {
    let named = kinds.iter().filter_map(|kind| {
        let node = &table.entry(kind.key)?.node;
        let path = home.file(node.as_text()?, node.span);
        path.is_file().then_some(NamedFile { kind: *kind, path, span: node.span })
    });
    named.collect()
}

/// Returns the role of a file with the keys of `tree`.
fn role(tree: &Table) -> Role {
    let has = |keys: &[&str]| keys.iter().any(|key| tree.entry(key).is_some());
    match (has(&["robot", "behaviors", "run", "arbiter"]), has(&["devices", "sensors", "drive", "footprint"]))
    {
        (true, false) => Role::Task,
        (false, true) => Role::Robot,
        _ => Role::Unknown,
    }
}

/// Adds the entries of `part` to `table`; `path` is the dotted path of `table`. A key in both must be a table in both.
fn merge_part(table: &mut Table, part: Table, path: &str, problems: &mut Vec<Problem>) {
    for entry in part.entries {
        let Some(own) = table.entry_mut(&entry.key) else {
            table.entries.push(entry);
            continue;
        };
        let key_path = format!("{path}{}", entry.key);
        match (&mut own.node.value, entry.node.value) {
            (Value::Table(table), Value::Table(part)) => {
                merge_part(table, part, &format!("{key_path}."), problems);
            }
            _ => problems.push(
                Problem::new(own.key_span, format!("`{key_path}` is set twice"))
                    .label("set here")
                    .also(entry.key_span, "set in the included file")
                    .help("remove one of them; `--set robot.KEY=VALUE` changes a key for one run"),
            ),
        }
    }
}
