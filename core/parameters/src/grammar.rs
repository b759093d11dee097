//! Explanations of TOML syntax errors.

use std::ops::Range;

use super::brackets::{Unclosed, unclosed};
use super::problem::{Problem, Span};

/// Adds the parser's errors to `problems`, at most one per line. A bracket or quotes that are not closed are one error: what
/// the parser reports after them follows from it.
pub fn explain(
    text: &str,
    source: usize,
    mut errors: Vec<(Range<usize>, &str)>,
    problems: &mut Vec<Problem>,
) {
    errors.sort_by_key(|(range, _)| range.start);
    let unclosed = unclosed(text);
    if let Some(Unclosed::Bracket(at) | Unclosed::Quotes(at)) = unclosed {
        errors.retain(|(range, _)| range.start < at);
    }
    let mut last_line = None;
    let mut in_second_table = 0;
    for (range, message) in errors {
        let line = Line::around(text, range.start);
        let twice = message.contains("duplicate key");
        if last_line.replace(line.start) == Some(line.start) || (twice && range.start < in_second_table) {
            continue;
        }
        let span = Span { source, start: range.start, end: range.end };
        if twice {
            if line.is_header() {
                in_second_table = line.next_header(text);
            }
            problems.push(set_twice(text, span, &line));
        } else {
            problems.push(not_toml(span, &line, message));
        }
    }
    problems.extend(unclosed.map(|unclosed| not_closed(text, source, unclosed)));
}

fn not_closed(text: &str, source: usize, unclosed: Unclosed) -> Problem {
    let (what, at, length, help) = match unclosed {
        Unclosed::Quotes(at) => ("string", at, 1, "end it with the quotes with which it begins"),
        Unclosed::Bracket(at) if text[at..].starts_with('{') => {
            ("table", at, 1, "add } after its last value, or remove {")
        }
        Unclosed::Bracket(at) => ("array", at, 1, "add ] after its last item, or remove ["),
    };
    Problem::new(Span { source, start: at, end: at + length }, format!("this {what} is not closed"))
        .label("opened here")
        .help(help)
}

/// Line of a text.
struct Line<'a> {
    start: usize,
    text: &'a str,
}

impl<'a> Line<'a> {
    fn around(text: &'a str, byte: usize) -> Line<'a> {
        let before = text.get(..byte.min(text.len())).unwrap_or("");
        let start = before.rfind('\n').map_or(0, |at| at + 1);
        Line { start, text: text.get(start..).and_then(|rest| rest.lines().next()).unwrap_or("") }
    }

    fn is_header(&self) -> bool {
        self.text.trim_start().starts_with('[') && !self.text.contains('=')
    }

    /// Returns the key before `=`, or the whole header.
    fn name(&self) -> &'a str {
        self.text.split('=').next().unwrap_or("").trim()
    }

    fn next_header(&self, text: &str) -> usize {
        let end = self.start + self.text.len();
        let next = text.get(end..).and_then(|rest| rest.find("\n["));
        next.map_or(text.len(), |at| end + at)
    }
}

fn set_twice(text: &str, span: Span, line: &Line<'_>) -> Problem {
    let before = text.get(..line.start).unwrap_or("");
    let mut first = None;
    let mut at = 0;
    for earlier in before.split_inclusive('\n') {
        let earlier_line = Line { start: at, text: earlier.trim_end_matches(['\n', '\r']) };
        if earlier_line.is_header() && !line.is_header() {
            first = None;
        }
        if earlier_line.name() == line.name() {
            first =
                Some(Span { source: span.source, start: at, end: at + earlier_line.text.trim_end().len() });
        }
        at += earlier.len();
    }
    let what = if line.is_header() { "table is defined" } else { "key is set" };
    let problem = Problem::new(span, format!("this {what} twice")).label("second definition");
    let problem = problem.help("remove one of them");
    match first {
        Some(first) => problem.also(first, "first definition"),
        None => problem,
    }
}

fn not_toml(span: Span, line: &Line<'_>, message: &str) -> Problem {
    let rest = line.text.get(span.start.saturating_sub(line.start)..).unwrap_or("");
    let word: String =
        rest.chars().take_while(|&c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | '/')).collect();
    let bare = word.chars().next().is_some_and(char::is_alphabetic)
        && (message.contains("quoted") || message.contains("invalid boolean"));
    let trimmed = line.text.trim();
    if bare {
        return Problem::new(span, "this string has no quotes")
            .label("quotes expected")
            .help(format!("write \"{word}\""));
    }
    if trimmed.starts_with('[') && !trimmed.contains('=') && !trimmed.ends_with(']') {
        return Problem::new(span, "a bracket is missing")
            .label("`]` expected")
            .help(format!("write {trimmed}]"));
    }
    if trimmed.ends_with(']') && !trimmed.contains(['=', '[']) {
        return Problem::new(span, "a bracket is missing")
            .label("`[` expected")
            .help(format!("write [{trimmed}"));
    }
    if let Some(bracket @ (']' | '}')) = rest.chars().next() {
        return Problem::new(span, "this bracket closes nothing")
            .label(format!("no `{}` is open", if bracket == ']' { '[' } else { '{' }))
            .help("remove it");
    }
    if let Some((key, "")) = trimmed.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
        return Problem::new(span, format!("`{key}` has no value")).label("value expected").help(format!(
            "write {key} = followed by a number, \"string\", true, [array] or {{ key = \"table\" }}"
        ));
    }
    Problem::new(span, "this is not valid TOML")
        .label(message.to_owned())
        .help("a line is `key = value`, `[table]` or `# comment`")
}
