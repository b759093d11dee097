//! Text that is safe to print: no control characters, no endless lines.

use super::problem::{Source, Span};

/// Maximum length of a source line that is printed whole, bytes.
const MAX_LINE_BYTES: usize = 200;
/// Length of the part of a longer line that is printed, bytes.
const EXCERPT_BYTES: usize = 120;
/// Maximum length of a message, characters.
const MAX_MESSAGE_CHARS: usize = 500;

/// Source text as it is printed, with the same number of lines.
pub(crate) struct Excerpt {
    /// Printed text.
    pub text: String,
    /// Removed byte ranges of the source, with the position of each in the printed text.
    removed: Vec<(std::ops::Range<usize>, usize)>,
}

/// Text in place of a removed part.
const GAP: &str = "...";

impl Excerpt {
    /// Replaces control characters, and shortens long lines to the part around the first of the spans in it.
    pub fn of<'a>(source: &Source, spans: impl Iterator<Item = &'a Span>) -> Excerpt {
        let starts: Vec<usize> = spans.map(|span| span.start).collect();
        let mut excerpt = Excerpt { text: String::new(), removed: Vec::new() };
        let mut at = 0;
        for line in source.text.split_inclusive('\n') {
            let range = at..at + line.len();
            at = range.end;
            if line.len() <= MAX_LINE_BYTES {
                excerpt.keep(&source.text[range]);
                continue;
            }
            let focus = starts.iter().copied().find(|start| range.contains(start)).unwrap_or(range.start);
            let from = boundary(&source.text, focus.saturating_sub(EXCERPT_BYTES / 2).max(range.start));
            let to = boundary(&source.text, (from + EXCERPT_BYTES).min(range.end));
            let end = range.end - usize::from(line.ends_with('\n'));
            excerpt.remove(range.start..from);
            excerpt.keep(&source.text[from..to.min(end)]);
            excerpt.remove(to.min(end)..end);
            excerpt.keep(&source.text[end..range.end]);
        }
        excerpt
    }

    /// Returns the position in the printed text of a byte of the source.
    pub fn position(&self, byte: usize) -> usize {
        let mut shift = 0_isize;
        for (range, at) in &self.removed {
            if byte < range.start {
                break;
            }
            if byte < range.end {
                return *at;
            }
            shift = (*at + GAP.len()) as isize - range.end as isize;
        }
        (byte as isize + shift).max(0) as usize
    }

    /// Appends text with control characters replaced by characters of the same length.
    fn keep(&mut self, text: &str) {
        let replaced = text.chars().map(|c| match c {
            '\n' | '\t' | '\r' => c,
            c if !is_unprintable(c) => c,
            c if c.len_utf8() == 1 => '?',
            c if c.len_utf8() == 2 => '\u{b7}',
            c if c.len_utf8() == 3 => '\u{fffd}',
            c => c,
        });
        self.text.extend(replaced);
    }

    fn remove(&mut self, range: std::ops::Range<usize>) {
        if !range.is_empty() {
            self.removed.push((range, self.text.len()));
            self.text.push_str(GAP);
        }
    }
}

/// Returns the character boundary at or before `byte`.
fn boundary(text: &str, byte: usize) -> usize {
    (0..=byte).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// Returns true for control characters and for characters that change the direction of text.
fn is_unprintable(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Escapes control characters, and shortens long text.
pub(crate) fn printable(text: &str) -> String {
    let mut printed = String::new();
    for (count, c) in text.chars().enumerate() {
        if count == MAX_MESSAGE_CHARS {
            printed.push_str(GAP);
            break;
        }
        match c {
            '\n' => printed.push('\n'),
            c if is_unprintable(c) => printed.extend(c.escape_unicode()),
            c => printed.push(c),
        }
    }
    printed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_shortened_around_the_span() {
        let text = format!("a = 1\n{}here{}\nb = 2\n", "x".repeat(5000), "y".repeat(5000));
        let start = text.find("here").unwrap();
        let source = Source { name: "t".into(), text };
        let span = Span { source: 0, start, end: start + 4 };
        let excerpt = Excerpt::of(&source, [span].iter());
        assert!(excerpt.text.len() < 200, "{}", excerpt.text.len());
        assert_eq!(excerpt.text.lines().count(), 3);
        let at = excerpt.position(start);
        assert_eq!(&excerpt.text[at..at + 4], "here");
        let b = source.text.find("b = 2").unwrap();
        assert!(excerpt.text[excerpt.position(b)..].starts_with("b = 2"));
    }

    #[test]
    fn control_characters_are_not_printed() {
        let source = Source { name: "t".into(), text: "a = \"\u{7}\u{85}\u{202e}\"\n".into() };
        let excerpt = Excerpt::of(&source, [].iter());
        assert_eq!(excerpt.text.len(), source.text.len());
        assert!(!excerpt.text.chars().any(|c| c != '\n' && is_unprintable(c)));
        assert_eq!(printable("a\u{7}b"), "a\\u{7}b");
    }
}
