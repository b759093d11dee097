//! Brackets and quotes of a TOML text: nesting that is too deep, and brackets or quotes that are not closed.

/// Maximum number of dots in a key; the parser recurses once per part, anew within each bracket.
pub(crate) const MAX_DOTS: usize = 16;
/// Maximum nesting of brackets.
pub(crate) const MAX_NESTED: usize = 16;

/// Bracket or quotes that are opened but not closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unclosed {
    /// Bracket of an array or an inline table, at this byte.
    Bracket(usize),
    /// Quotes of a string, at this byte.
    Quotes(usize),
}

/// Finds the first bracket or quotes that an entry opens and does not close before the next entry begins.
pub(crate) fn unclosed(text: &str) -> Option<Unclosed> {
    let bytes = text.as_bytes();
    let mut open: Vec<usize> = Vec::new();
    let mut last = b'\n';
    let mut at = 0;
    while at < bytes.len() {
        if at == 0 || bytes[at - 1] == b'\n' {
            let line = text[at..].lines().next().unwrap_or("");
            match open.last() {
                // The parser reports the errors of a header itself.
                None if line.trim_start().starts_with('[') => at += line.len(),
                Some(&bracket) if begins_entry(line, bytes[bracket], last) => {
                    return Some(Unclosed::Bracket(bracket));
                }
                _ => {}
            }
        }
        match bytes.get(at) {
            Some(b'#') => at += text[at..].find('\n').unwrap_or(text.len() - at),
            Some(&quote @ (b'"' | b'\'')) => {
                let Ok(end) = after_quotes(bytes, at) else { return Some(Unclosed::Quotes(at)) };
                (at, last) = (end, quote);
            }
            Some(&byte) => {
                match byte {
                    b'[' | b'{' => open.push(at),
                    b']' | b'}' => drop(open.pop()),
                    _ => {}
                }
                if !byte.is_ascii_whitespace() {
                    last = byte;
                }
                at += 1;
            }
            None => {}
        }
    }
    open.last().copied().map(Unclosed::Bracket)
}

/// Returns true if a line inside an open `bracket` begins the next entry of the file, `key = value` or `[table]`. `last` is
/// the last byte before the line outside of spaces and comments.
fn begins_entry(line: &str, bracket: u8, last: u8) -> bool {
    let is_of_key = |c: char| c.is_alphanumeric() || "-_. \"'".contains(c);
    let line = line.split('#').next().unwrap_or("").trim();
    let continues = matches!(last, b',' | b'{' | b'[');
    if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
        let name = name.trim_start_matches('[').trim_end_matches(']');
        return !continues && name.starts_with(char::is_alphabetic) && name.chars().all(is_of_key);
    }
    let Some((key, _)) = line.split_once('=') else { return false };
    let key = key.trim();
    !key.is_empty() && key.chars().all(is_of_key) && (bracket == b'[' || !continues)
}

/// Returns the position and description of nesting that is too deep for the parser's stack.
pub(crate) fn too_deep(text: &str) -> Option<(usize, String)> {
    let bytes = text.as_bytes();
    let (mut at, mut key, mut dots, mut nested) = (0, 0, 0, 0_usize);
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'#' => {
                at += text[at..].find('\n').unwrap_or(text.len() - at);
                continue;
            }
            b'"' | b'\'' => {
                at = after_quotes(bytes, at).unwrap_or_else(|end| end);
                continue;
            }
            b'[' | b'{' => nested += 1,
            b']' | b'}' => nested = nested.saturating_sub(1),
            b'.' => dots += 1,
            _ => {}
        }
        if matches!(byte, b'\n' | b'=' | b',' | b'[' | b']' | b'{' | b'}') {
            (dots, key) = (0, at + 1);
        } else if key == at && matches!(byte, b' ' | b'\t') {
            key += 1;
        }
        if nested > MAX_NESTED {
            return Some((at, format!("brackets are nested more than {MAX_NESTED} deep")));
        }
        if dots > MAX_DOTS {
            return Some((key, format!("a key has more than {MAX_DOTS} dots")));
        }
        at += 1;
    }
    None
}

/// Returns the end of the string whose quotes open at `open`, as an error if it is not closed. A single-line string ends
/// with its line at the latest.
fn after_quotes(bytes: &[u8], open: usize) -> Result<usize, usize> {
    let quote = bytes[open];
    let long = bytes[open..].starts_with(&[quote; 3]);
    let mut at = open + if long { 3 } else { 1 };
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'\\' if quote == b'"' => at += 1,
            b'\n' if !long => return Err(at),
            _ if byte == quote && !long => return Ok(at + 1),
            _ if long && bytes[at..].starts_with(&[quote; 3]) => return Ok(at + 3),
            _ => {}
        }
        at += 1;
    }
    Err(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bracket_that_is_not_closed_is_found() {
        for (text, at) in [
            ("a = [1, 2\nb = 3\n", 4),
            ("a = [[1], [2]\n# b\n[c]\nd = 1", 4),
            ("a = [1, 2", 4),
            ("[a]\nb = { c = 1\nd = 2 ]", 8),
            ("a = [\n  [1, 2],\n  [3, 4]\n\n[b.c]\nd = 1", 4),
            ("a = { b = 1, c = [2 }\nd = 1", 4),
        ] {
            assert_eq!(unclosed(text), Some(Unclosed::Bracket(at)), "{text}");
        }
        for text in
            ["a = 1\nb = \"\"\"c\n[d]", "a = 1\nb = \"c\n[d]", "a = 1\nb = 'c", "a = 1\nb = \"c\\\"\n"]
        {
            assert_eq!(unclosed(text), Some(Unclosed::Quotes(10)), "{text}");
        }
    }

    #[test]
    fn brackets_over_several_lines_are_closed() {
        for text in [
            "a = [\n  1, # ]\n  [2],\n  { b = 3 },\n]\n[c]\nd = 4",
            "a = [\n  \"[\",\n  '{',\n]",
            "a = {\n  b = 1,\n  c = 2,\n}",
            "a = '''\n[b]\n'''\n[[c]]\nd = \"\"\"e\"\"\"",
            "[a\nb = 1",
        ] {
            assert_eq!(unclosed(text), None, "{text}");
        }
    }
}
