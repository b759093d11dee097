//! A TOML text as a tree in which every key and value knows where it stands.

use toml::de::{DeTable, DeValue};
use toml::value::Datetime;

use super::problem::{Problem, Span};

/// Longest text that is read, bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// Most dots in a key that is read; the parser recurses once a part, within each bracket anew.
const MAX_DOTS: usize = 16;
/// Deepest bracket within brackets that is read.
const MAX_NESTED: usize = 16;

/// A value and where it stands.
#[derive(Clone, Debug)]
pub struct Node {
    pub span: Span,
    pub value: Value,
}

/// What TOML can say.
#[derive(Clone, Debug)]
pub enum Value {
    Text(String),
    Whole(i64),
    Number(f64),
    Switch(bool),
    Moment(Datetime),
    List(Vec<Node>),
    Table(Table),
}

/// Keys and values in the order of the text.
#[derive(Clone, Debug, Default)]
pub struct Table {
    pub entries: Vec<Entry>,
}

/// One key of a table.
#[derive(Clone, Debug)]
pub struct Entry {
    pub key: String,
    pub key_span: Span,
    pub node: Node,
}

impl Table {
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    pub fn entry_mut(&mut self, key: &str) -> Option<&mut Entry> {
        self.entries.iter_mut().find(|entry| entry.key == key)
    }

    /// The table under `key`; `None` where it is missing or no table.
    pub fn table(&self, key: &str) -> Option<&Table> {
        self.entry(key)?.node.as_table()
    }

    /// Where the value of the dotted `path`, such as `door[2].at_m`, stands, or as much of the path as there is.
    pub fn span_of(&self, path: &str) -> Option<Span> {
        let (first, rest) = path.split_once('.').unwrap_or((path, ""));
        let (key, index) = match first.strip_suffix(']').and_then(|first| first.split_once('[')) {
            Some((key, index)) => (key, index.parse::<usize>().ok()),
            None => (first, None),
        };
        let mut node = &self.entry(key)?.node;
        if let (Value::List(items), Some(index)) = (&node.value, index) {
            node = items.get(index).unwrap_or(node);
        }
        let deeper = node.as_table().and_then(|table| table.span_of(rest));
        Some(deeper.unwrap_or(node.span))
    }

    /// The plain TOML table with the keys that `keep` picks.
    pub fn to_toml(&self, keep: impl Fn(&str) -> bool) -> toml::Table {
        let kept = self.entries.iter().filter(|entry| keep(&entry.key));
        kept.map(|entry| (entry.key.clone(), entry.node.to_toml())).collect()
    }
}

impl Node {
    pub fn as_table(&self) -> Option<&Table> {
        match &self.value {
            Value::Table(table) => Some(table),
            _ => None,
        }
    }

    pub fn as_text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The plain TOML value.
    pub fn to_toml(&self) -> toml::Value {
        match &self.value {
            Value::Text(text) => toml::Value::String(text.clone()),
            Value::Whole(number) => toml::Value::Integer(*number),
            Value::Number(number) => toml::Value::Float(*number),
            Value::Switch(on) => toml::Value::Boolean(*on),
            Value::Moment(moment) => toml::Value::Datetime(*moment),
            Value::List(items) => toml::Value::Array(items.iter().map(Node::to_toml).collect()),
            Value::Table(table) => toml::Value::Table(table.to_toml(|_| true)),
        }
    }

    /// What kind of value it is, with its article.
    pub fn kind(&self) -> &'static str {
        match self.value {
            Value::Text(_) => "a text",
            Value::Whole(_) => "a whole number",
            Value::Number(_) => "a number",
            Value::Switch(_) => "true or false",
            Value::Moment(_) => "a date or time",
            Value::List(_) => "a list",
            Value::Table(_) => "a table",
        }
    }
}

/// Reads the text of source number `source`; every mistake of grammar is added to `problems`.
pub fn parse(text: &str, source: usize, problems: &mut Vec<Problem>) -> Option<Table> {
    if let Some((at, what)) = too_deep(text) {
        let span = Span { source, start: at, end: at + 1 };
        problems.push(Problem::new(span, what).label("here").help("tables here are at most five deep"));
        return None;
    }
    let (root, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return Some(Reader { source, problems }.table(root.get_ref()));
    }
    let grammar = errors.iter().map(|error| (error.span().unwrap_or(0..0), error.message()));
    super::grammar::explain(text, source, grammar, problems);
    None
}

/// Where `text` goes deeper than the parser's stack, and what is too deep there.
fn too_deep(text: &str) -> Option<(usize, String)> {
    let bytes = text.as_bytes();
    let (mut at, mut key, mut dots, mut nested) = (0, 0, 0, 0_usize);
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'#' => {
                at += text[at..].find('\n').unwrap_or(text.len() - at);
                continue;
            }
            b'"' | b'\'' => {
                at = after_quotes(bytes, at);
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
            return Some((at, format!("brackets stand more than {MAX_NESTED} deep in each other")));
        }
        if dots > MAX_DOTS {
            return Some((key, format!("a key has more than {MAX_DOTS} dots")));
        }
        at += 1;
    }
    None
}

/// The byte after the text whose quotes open at `open`; one with single quotes ends with its line at the latest.
fn after_quotes(bytes: &[u8], open: usize) -> usize {
    let quote = bytes[open];
    let long = bytes[open..].starts_with(&[quote; 3]);
    let mut at = open + if long { 3 } else { 1 };
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'\\' if quote == b'"' => at += 1,
            b'\n' if !long => return at,
            _ if byte == quote && !long => return at + 1,
            _ if long && bytes[at..].starts_with(&[quote; 3]) => return at + 3,
            _ => {}
        }
        at += 1;
    }
    bytes.len()
}

struct Reader<'a> {
    source: usize,
    problems: &'a mut Vec<Problem>,
}

impl Reader<'_> {
    fn span(&self, range: std::ops::Range<usize>) -> Span {
        Span { source: self.source, start: range.start, end: range.end }
    }

    fn table(&mut self, table: &DeTable<'_>) -> Table {
        let mut entries: Vec<Entry> = table
            .iter()
            .map(|(key, value)| Entry {
                key: key.get_ref().to_string(),
                key_span: self.span(key.span()),
                node: self.node(value.get_ref(), value.span()),
            })
            .collect();
        entries.sort_by_key(|entry| entry.key_span.start);
        Table { entries }
    }

    fn node(&mut self, value: &DeValue<'_>, range: std::ops::Range<usize>) -> Node {
        let span = self.span(range);
        let value = match value {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
                Ok(number) => Value::Whole(number),
                Err(_) => self.too_large(span, number.as_str()),
            },
            DeValue::Float(number) => Value::Number(number.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(on) => Value::Switch(*on),
            DeValue::Datetime(moment) => Value::Moment(*moment),
            DeValue::Array(items) => {
                Value::List(items.iter().map(|item| self.node(item.get_ref(), item.span())).collect())
            }
            DeValue::Table(table) => Value::Table(self.table(table)),
        };
        Node { span, value }
    }

    fn too_large(&mut self, span: Span, number: &str) -> Value {
        self.problems.push(
            Problem::new(span, "this number has too many digits")
                .label(format!("{} digits", number.len()))
                .help("whole numbers go up to 9223372036854775807"),
        );
        Value::Whole(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How deep tables and lists stand in each other.
    fn depth(node: &Node) -> usize {
        let inside = match &node.value {
            Value::Table(table) => table.entries.iter().map(|entry| depth(&entry.node)).max(),
            Value::List(items) => items.iter().map(depth).max(),
            _ => None,
        };
        1 + inside.unwrap_or(0)
    }

    fn refused(text: &str) -> bool {
        let mut problems = Vec::new();
        let table = parse(text, 0, &mut problems);
        assert_eq!(table.is_none(), !problems.is_empty(), "{problems:?}");
        problems.iter().any(|problem| problem.message.contains("more than"))
    }

    #[test]
    fn depth_is_bounded_as_a_whole() {
        let dotted = |dots: usize| vec!["a"; dots + 1].join(".");
        let tables = |depth: usize, dots: usize| {
            format!("{}1{}", format!("{} = {{", dotted(dots)).repeat(depth) + "b = ", "}".repeat(depth))
        };
        assert!(!refused(&tables(MAX_NESTED, MAX_DOTS)));
        assert!(refused(&tables(MAX_NESTED + 1, 0)));
        assert!(refused(&tables(1, MAX_DOTS + 1)));
        assert!(refused(&tables(2000, 60)));
        let table = parse(&tables(MAX_NESTED, MAX_DOTS), 0, &mut Vec::new()).unwrap();
        assert_eq!(depth(&table.entries[0].node), (MAX_DOTS + 1) * MAX_NESTED + 1);
    }

    #[test]
    fn dots_and_brackets_in_texts_and_comments_do_not_count() {
        let dots = "[{.".repeat(40);
        for text in [
            format!("a = 1 # {dots}"),
            format!("# {dots}\na = 1"),
            format!("a = \"{dots}\""),
            format!("a = \"\\\"{dots}\""),
            format!("a = '{dots}'"),
            format!("a = \"\"\"\n{dots}\n\"\"\""),
            format!("a = '''\n{dots}\n'''"),
            "a = [[1], [2]]\n[[b]]\n".to_owned(),
        ] {
            assert!(!refused(&text), "{text}");
        }
        assert!(refused(&format!("a = \"b\" # c\n{}d = 1", "e.".repeat(MAX_DOTS + 1))));
    }
}
