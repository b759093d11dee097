//! Files and folders named by the parameters of plugins.
//!
//! A key whose schema has `"format": "file"` or `"folder"` names an existing one, with `"file or folder"` either; `"path"`
//! names anything, such as a pattern. A path is relative to the file that contains it, or to the working directory on the
//! command line.

use std::path::{Component, Path, PathBuf};

use serde_json::Value as Json;

use yamabico_parameters::{Problem, Shape, Span, Table, nearest};

/// File that contains a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Home<'a> {
    pub source: usize,
    pub path: &'a Path,
    /// Folders of included files, by source.
    pub parts: &'a [(usize, PathBuf)],
}

impl Home<'_> {
    /// Returns the folder of the file.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Resolves the path `text` at `span`.
    pub fn file(&self, text: &str, span: Span) -> PathBuf {
        if span.source == self.source {
            return tidy(&self.folder().join(text));
        }
        match self.parts.iter().find(|(source, _)| *source == span.source) {
            Some((_, folder)) => tidy(&folder.join(text)),
            None => PathBuf::from(text),
        }
    }
}

/// Checks that the files and folders named by `table` exist. Replaces paths that are not relative to the folder of
/// `home` in `keys` by absolute paths.
pub(crate) fn resolve_paths(
    table: &Table,
    schema: &Json,
    home: Home<'_>,
    keys: &mut toml::Table,
    problems: &mut Vec<Problem>,
) {
    for (key, shape) in Shape::new(schema).resolved().properties() {
        let format = shape.resolved().text("format").or(shape.text("format"));
        let Some(format @ ("file" | "folder" | "file or folder" | "path")) = format else { continue };
        let Some(entry) = table.entry(key) else { continue };
        let Some(text) = entry.node.as_text() else { continue };
        let is_elsewhere = entry.node.span.source != home.source;
        let path = home.file(text, entry.node.span);
        let is_there = match format {
            "file" => path.is_file(),
            "folder" => path.is_dir(),
            "file or folder" => path.exists(),
            _ => true,
        };
        if !is_there {
            problems.push(
                Problem::new(entry.node.span, missing(format, &path))
                    .label("referenced here")
                    .help(what_is_near(&path)),
            );
        }
        if is_elsewhere && let Ok(path) = std::path::absolute(&path) {
            keys.insert(key.to_owned(), toml::Value::String(path.to_string_lossy().into_owned()));
        }
    }
}

/// Returns the error of a missing file or folder; `what` is "file", "folder" or "file or folder".
pub(crate) fn missing(what: &str, path: &Path) -> String {
    format!("{what} {} does not exist", path.display())
}

/// Returns a hint about existing files near a missing one.
pub(crate) fn what_is_near(path: &Path) -> String {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let shown =
        if folder == Path::new(".") { "this folder".to_owned() } else { folder.display().to_string() };
    let Ok(files) = std::fs::read_dir(folder) else {
        return format!("folder {} does not exist either", folder.display());
    };
    let names = files.filter_map(|file| file.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
    names.sort();
    let wrong = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
    // A common extension does not make names similar.
    let ending = path.extension().map_or(String::new(), |ending| format!(".{}", ending.to_string_lossy()));
    let stems = names.iter().filter_map(|name| name.strip_suffix(&ending));
    match nearest(wrong.strip_suffix(&ending).unwrap_or(wrong), stems) {
        Some(stem) => format!("did you mean {}?", tidy(&folder.join(format!("{stem}{ending}"))).display()),
        None if names.is_empty() => format!("{shown} is empty"),
        None => {
            let more = if names.len() > 8 { ", ..." } else { "" };
            names.truncate(8);
            format!("{shown} contains: {}{more}", names.join(", "))
        }
    }
}

/// Returns the absolute form of `path` without `.` and `x/..`.
///
/// # Errors
/// The working directory is unknown.
pub fn absolute(path: &Path) -> std::io::Result<PathBuf> {
    Ok(tidy(&std::path::absolute(path)?))
}

/// Removes `.` and `x/..` from a path.
pub(crate) fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(tidy.components().next_back(), Some(Component::Normal(_))) => {
                tidy.pop();
            }
            part => tidy.push(part),
        }
    }
    tidy
}
