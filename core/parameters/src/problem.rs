//! Configuration errors with source spans.

use std::fmt;

use ariadne::{Config, IndexType, Label, Report, ReportKind};
use serde::Serialize;

use super::excerpt::{Excerpt, printable};

/// Byte range of a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span {
    /// Index into [`Problems::sources`].
    pub source: usize,
    /// Start, bytes.
    pub start: usize,
    /// End, bytes, exclusive.
    pub end: usize,
}

/// Source text of a configuration: a file, or an argument of the command line.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Path of the file, or the name of the argument, such as `--set`.
    pub name: String,
    /// Content.
    pub text: String,
}

impl Source {
    /// Returns line and column of a byte, from 1; columns count characters.
    fn position(&self, byte: usize) -> (usize, usize) {
        let before = self.text.get(..self.floor(byte)).unwrap_or("");
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
        (line, column)
    }

    fn floor(&self, byte: usize) -> usize {
        let byte = byte.min(self.text.len());
        (0..=byte).rev().find(|&at| self.text.is_char_boundary(at)).unwrap_or(0)
    }

    /// Returns true for an argument of the command line, which has no lines.
    fn is_argument(&self) -> bool {
        self.name.starts_with("--")
    }

    fn range(&self, span: Span) -> std::ops::Range<usize> {
        let start = self.floor(span.start);
        start..self.floor(span.end).max(start)
    }
}

/// Configuration error.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Source span.
    pub span: Span,
    /// Error message, one line.
    pub message: String,
    /// Note at the span.
    pub label: String,
    /// Remedy.
    pub help: Option<String>,
    /// Related spans with a note each.
    pub also: Vec<(Span, String)>,
}

impl Problem {
    /// Creates the error `message` at `span`.
    pub fn new(span: Span, message: impl Into<String>) -> Problem {
        Problem { span, message: message.into(), label: "here".into(), help: None, also: Vec::new() }
    }

    /// Sets the note at the span.
    pub fn label(mut self, label: impl Into<String>) -> Problem {
        self.label = label.into();
        self
    }

    /// Sets the remedy.
    pub fn help(mut self, help: impl Into<String>) -> Problem {
        self.help = Some(help.into());
        self
    }

    /// Adds a related span.
    pub fn also(mut self, span: Span, label: impl Into<String>) -> Problem {
        self.also.push((span, label.into()));
        self
    }
}

/// All errors in a configuration.
#[derive(Clone, Debug, Default)]
pub struct Problems {
    /// Source texts.
    pub sources: Vec<Source>,
    /// Errors.
    pub problems: Vec<Problem>,
}

/// Error as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Path of the file, or the name of the argument, such as `--set`.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Error message.
    pub message: String,
    /// Note at the span.
    pub label: String,
    /// Remedy.
    pub help: Option<String>,
}

/// Style of rendered text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// No escape codes, for files and pipes.
    Plain,
    /// Escape codes for a terminal.
    Colored,
}

impl Problems {
    /// Returns the number of errors.
    pub fn len(&self) -> usize {
        self.problems.len()
    }

    /// Returns true if there are no errors.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Returns all errors as data, ordered by file and line.
    pub fn entries(&self) -> Vec<Entry> {
        let entry = |problem: &Problem| {
            let source = self.sources.get(problem.span.source)?;
            let (line, column) = source.position(problem.span.start);
            Some(Entry {
                file: source.name.clone(),
                line,
                column,
                message: problem.message.clone(),
                label: problem.label.clone(),
                help: problem.help.clone(),
            })
        };
        self.problems.iter().filter_map(entry).collect()
    }

    /// Renders all errors with their source lines and remedies.
    pub fn render(&self, style: Style) -> String {
        let reports = self.problems.iter().map(|problem| self.report(problem, style));
        reports.collect::<Vec<_>>().join("\n")
    }

    fn report(&self, problem: &Problem, style: Style) -> String {
        let config = Config::new().with_index_type(IndexType::Byte).with_color(style == Style::Colored);
        let spans: Vec<Span> =
            std::iter::once(problem.span).chain(problem.also.iter().map(|(span, _)| *span)).collect();
        let excerpts: Vec<Excerpt> = (0..self.sources.len())
            .map(|index| Excerpt::of(&self.sources[index], spans.iter().filter(|span| span.source == index)))
            .collect();
        let place = |span: Span| {
            let range = self.sources.get(span.source)?.range(span);
            let excerpt = excerpts.get(span.source)?;
            Some((span.source, excerpt.position(range.start)..excerpt.position(range.end)))
        };
        let message = printable(&problem.message);
        let source = self.sources.get(problem.span.source);
        let (Some(source), Some(span)) =
            (source.filter(|source| !source.text.is_empty()), place(problem.span))
        else {
            return without_excerpt(problem, source);
        };
        let mut labels = vec![(problem.span, &problem.label, ariadne::Color::Red)];
        labels.extend(problem.also.iter().map(|(span, label)| (*span, label, ariadne::Color::Yellow)));
        // Labels of one file in the order of its lines share one excerpt.
        labels.sort_by_key(|(span, ..)| (span.source != problem.span.source, *span));
        let labels = labels.into_iter().filter_map(|(span, label, color)| {
            Some(Label::new(place(span)?).with_message(printable(label)).with_color(color))
        });
        let mut report = Report::build(ReportKind::Error, span)
            .with_config(config)
            .with_message(&message)
            .with_labels(labels);

        if let Some(help) = &problem.help {
            report = report.with_help(printable(help));
        }
        let mut bytes = Vec::new();
        match report.finish().write(Shelf::of(&self.sources, excerpts), &mut bytes) {
            Ok(()) => {
                let text = plain_ends(&String::from_utf8_lossy(&bytes));
                if source.is_argument() { without_position(&text, &source.name) } else { text }
            }
            Err(error) => format!("Error: {message} ({error})\n"),
        }
    }

    /// Sorts the errors by source and span, and removes duplicates.
    pub fn sort(&mut self) {
        self.problems.sort_by_key(|problem| problem.span);
        self.problems.dedup();
    }
}

/// Renders an error in a source without text, such as an empty file.
fn without_excerpt(problem: &Problem, source: Option<&Source>) -> String {
    let mut text = format!("Error: {}\n", printable(&problem.message));
    if let Some(source) = source.filter(|_| !problem.label.is_empty()) {
        text += &format!("  In {}: {}\n", printable(&source.name), printable(&problem.label));
    }
    if let Some(help) = &problem.help {
        text += &format!("  Help: {}\n", printable(help));
    }
    text
}

/// Removes line and column from the title of an excerpt of the argument `name`.
fn without_position(text: &str, name: &str) -> String {
    let title = format!("[ {name}:");
    let line = |line: &str| match line.split_once(&title) {
        Some((before, _)) => format!("{before}[ {name} ]\n"),
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

/// Removes spaces at the ends of lines.
fn plain_ends(text: &str) -> String {
    text.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(Style::Plain))
    }
}

impl std::error::Error for Problems {}

/// Sources for the renderer.
struct Shelf(Vec<(ariadne::Source, String)>);

impl Shelf {
    fn of(sources: &[Source], excerpts: Vec<Excerpt>) -> Shelf {
        let names = sources.iter().map(|source| printable(&source.name));
        Shelf(excerpts.into_iter().map(|excerpt| ariadne::Source::from(excerpt.text)).zip(names).collect())
    }
}

impl ariadne::Cache<usize> for Shelf {
    type Storage = String;

    fn fetch(&mut self, id: &usize) -> Result<&ariadne::Source, impl fmt::Debug> {
        self.0.get(*id).map(|(source, _)| source).ok_or("no such source")
    }

    fn display<'a>(&self, id: &'a usize) -> Option<impl fmt::Display + 'a> {
        self.0.get(*id).map(|(_, name)| name.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rendered(name: &str, text: &str) -> String {
        let source = Source { name: name.to_owned(), text: text.to_owned() };
        let problem = Problem::new(Span { source: 0, start: 0, end: 1 }, "wrong").label("odd").help("do it");
        Problems { sources: vec![source], problems: vec![problem] }.to_string()
    }

    #[test]
    fn arguments_have_no_lines_and_empty_files_no_excerpt() {
        assert!(rendered("a.toml", "x = 1").contains("[ a.toml:1:1 ]"));
        let argument = rendered("--set", "x=1");
        assert!(argument.contains("[ --set ]") && argument.contains("x=1"), "{argument}");
        assert_eq!(rendered("a.toml", ""), "Error: wrong\n  In a.toml: odd\n  Help: do it\n");
    }
}
