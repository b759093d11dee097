//! What is wrong in a configuration, with a pointer to the place.

use std::fmt;

use ariadne::{Config, IndexType, Label, Report, ReportKind};
use serde::Serialize;

/// A stretch of a source, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span {
    pub source: usize,
    pub start: usize,
    pub end: usize,
}

/// A text that a configuration came from: a file, or one `--set`.
#[derive(Clone, Debug, Default)]
pub struct Source {
    pub name: String,
    pub text: String,
}

impl Source {
    /// Line and column, both from 1, of a byte; columns count characters.
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

    fn range(&self, span: Span) -> std::ops::Range<usize> {
        let start = self.floor(span.start);
        start..self.floor(span.end).max(start)
    }
}

/// One mistake.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    pub span: Span,
    pub message: String,
    pub label: String,
    pub help: Option<String>,
    pub also: Vec<(Span, String)>,
}

impl Problem {
    pub fn new(span: Span, message: impl Into<String>) -> Problem {
        Problem { span, message: message.into(), label: "here".into(), help: None, also: Vec::new() }
    }

    /// Says next to the caret `label`.
    pub fn label(mut self, label: impl Into<String>) -> Problem {
        self.label = label.into();
        self
    }

    /// Says what would be right.
    pub fn help(mut self, help: impl Into<String>) -> Problem {
        self.help = Some(help.into());
        self
    }

    /// Points to another place that has to do with it.
    pub fn also(mut self, span: Span, label: impl Into<String>) -> Problem {
        self.also.push((span, label.into()));
        self
    }
}

/// Everything that is wrong in a configuration.
#[derive(Clone, Debug, Default)]
pub struct Problems {
    pub sources: Vec<Source>,
    pub problems: Vec<Problem>,
}

/// One mistake as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// The file, or `--set`.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What is wrong.
    pub message: String,
    /// What is said about the place.
    pub label: String,
    /// What would be right.
    pub help: Option<String>,
}

/// How a text is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Without escape codes, for files and pipes.
    Plain,
    /// With the escape codes of a terminal.
    Colored,
}

impl Problems {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.problems.len()
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Every mistake as data, in the order of the files and lines.
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

    /// Every mistake with the line that it stands in and what would be right, for a person.
    pub fn render(&self, style: Style) -> String {
        let reports = self.problems.iter().map(|problem| self.report(problem, style));
        reports.collect::<Vec<_>>().join("\n")
    }

    fn report(&self, problem: &Problem, style: Style) -> String {
        let config = Config::new().with_index_type(IndexType::Byte).with_color(style == Style::Colored);
        let place = |span: Span| {
            let source = self.sources.get(span.source)?;
            Some((span.source, source.range(span)))
        };
        let Some(span) = place(problem.span) else { return format!("Error: {}\n", problem.message) };
        let mut labels = vec![(problem.span, &problem.label, ariadne::Color::Red)];
        labels.extend(problem.also.iter().map(|(span, label)| (*span, label, ariadne::Color::Yellow)));
        // Labels of one file in the order of its lines share one picture of it.
        labels.sort_by_key(|(span, ..)| (span.source != problem.span.source, *span));
        let labels = labels.into_iter().filter_map(|(span, label, color)| {
            Some(Label::new(place(span)?).with_message(label).with_color(color))
        });
        let mut report = Report::build(ReportKind::Error, span)
            .with_config(config)
            .with_message(&problem.message)
            .with_labels(labels);

        if let Some(help) = &problem.help {
            report = report.with_help(help);
        }
        let mut bytes = Vec::new();
        match report.finish().write(Shelf::of(&self.sources), &mut bytes) {
            Ok(()) => plain_ends(&String::from_utf8_lossy(&bytes)),
            Err(error) => format!("Error: {} ({error})\n", problem.message),
        }
    }

    pub fn sort(&mut self) {
        self.problems.sort_by_key(|problem| problem.span);
        self.problems.dedup();
    }
}

/// Without spaces at the ends of lines.
fn plain_ends(text: &str) -> String {
    text.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(Style::Plain))
    }
}

impl std::error::Error for Problems {}

/// The sources as the renderer wants them.
struct Shelf(Vec<(ariadne::Source, String)>);

impl Shelf {
    fn of(sources: &[Source]) -> Shelf {
        let shelve = |source: &Source| (ariadne::Source::from(source.text.clone()), source.name.clone());
        Shelf(sources.iter().map(shelve).collect())
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
