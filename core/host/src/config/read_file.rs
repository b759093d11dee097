//! Reading of the text of a configuration file.

use std::io::ErrorKind;
use std::path::Path;

use super::paths::{missing, what_is_near};
use yamabico_parameters::{MAX_BYTES, Problem, Source, Span};

/// Reason why a file has no text, and the remedy.
pub(crate) struct Unreadable {
    what: String,
    help: String,
    /// Text with replacement characters and the position of the first invalid byte, if only the encoding is wrong.
    readable: Option<(String, usize)>,
}

impl Unreadable {
    /// Returns the error: at `named_at`, the span that names the file; in the text of `source`, source number `number`, if
    /// only its encoding is wrong; else without a place.
    pub fn problem(self, source: &mut Source, number: usize, named_at: Option<Span>) -> Problem {
        let Unreadable { what, help, readable } = self;
        let problem = match (readable, named_at) {
            (Some((text, at)), _) => {
                source.text = text;
                let span = Span { source: number, start: at, end: at + 1 };
                let problem = Problem::new(span, what).label("not UTF-8");
                named_at.into_iter().fold(problem, |problem, at| problem.also(at, "referenced here"))
            }
            (None, Some(span)) => Problem::new(span, what).label("referenced here"),
            (None, None) => Problem::new(Span { source: number, start: 0, end: 0 }, what).label(""),
        };
        problem.help(help)
    }
}

impl std::fmt::Display for Unreadable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}; {}", self.what, self.help)
    }
}

/// Reads a configuration file.
///
/// # Errors
/// The file does not exist, is too large, or is not UTF-8, or this user must not read it.
pub(crate) fn read_text(path: &Path) -> Result<String, Unreadable> {
    let file = path.display();
    let wrong = |what: String, help: &str| Unreadable { what, help: help.to_owned(), readable: None };
    let failed = |error: std::io::Error| match error.kind() {
        ErrorKind::NotFound => wrong(missing("file", path), &what_is_near(path)),
        _ => wrong(format!("file {file} cannot be read: {error}"), "make it readable for this user"),
    };
    let data = std::fs::metadata(path).map_err(failed)?;
    if !data.is_file() {
        return Err(wrong(format!("{file} is not a file"), &what_is_near(&path.join("*"))));
    }
    if data.len() > MAX_BYTES as u64 {
        return Err(wrong(format!("file {file} is larger than 1 MiB"), "name a configuration file"));
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    String::from_utf8(bytes).map_err(|error| Unreadable {
        what: format!("file {file} is not UTF-8"),
        help: "save the file as UTF-8, or name a TOML file".to_owned(),
        readable: Some((
            String::from_utf8_lossy(error.as_bytes()).into_owned(),
            error.utf8_error().valid_up_to(),
        )),
    })
}
