//! TOML text as a tree with the source span of every key and value.

use toml::de::{DeTable, DeValue};
use toml::value::Datetime;

use super::brackets::too_deep;
use super::problem::{Problem, Span};

/// Maximum size of a text, bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// Value with its source span.
#[derive(Clone, Debug)]
pub struct Node {
    /// Source span.
    pub span: Span,
    /// Value.
    pub value: Value,
}

/// TOML value.
#[derive(Clone, Debug)]
pub enum Value {
    /// String.
    Text(String),
    /// Integer.
    Whole(i64),
    /// Float.
    Number(f64),
    /// Boolean.
    Switch(bool),
    /// Date or time.
    Moment(Datetime),
    /// Array.
    List(Vec<Node>),
    /// Table.
    Table(Table),
}

/// Table with its keys in the order of the text.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Keys with their values.
    pub entries: Vec<Entry>,
}

/// Key of a table, with its value.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Key.
    pub key: String,
    /// Source span of the key.
    pub key_span: Span,
    /// Value.
    pub node: Node,
}

impl Table {
    /// Returns the entry of `key`.
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// Returns the entry of `key` for modification.
    pub fn entry_mut(&mut self, key: &str) -> Option<&mut Entry> {
        self.entries.iter_mut().find(|entry| entry.key == key)
    }

    /// Returns the table under `key`, or `None` if it is missing or not a table.
    pub fn table(&self, key: &str) -> Option<&Table> {
        self.entry(key)?.node.as_table()
    }

    /// Returns the span of the value at the dotted `path`, such as `door[2].at_m`, or of the longest existing part of
    /// the path.
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

    /// Returns the dotted path, such as `door[2].at_m`, of the innermost key whose key or value contains byte `at`;
    /// empty if there is none.
    pub fn path_at(&self, at: usize) -> String {
        let contains = |span: Span| (span.start..span.end).contains(&at);
        let inside = |entry: &Entry| {
            let inner = match &entry.node.value {
                Value::Table(table) => table.path_at(at),
                _ => String::new(),
            };
            let is_here = contains(entry.key_span) || contains(entry.node.span) || !inner.is_empty();
            is_here
                .then(|| if inner.is_empty() { entry.key.clone() } else { format!("{}.{inner}", entry.key) })
        };
        self.entries.iter().find_map(inside).unwrap_or_default()
    }

    /// Converts the keys selected by `keep` to a plain TOML table.
    pub fn to_toml(&self, keep: impl Fn(&str) -> bool) -> toml::Table {
        let kept = self.entries.iter().filter(|entry| keep(&entry.key));
        kept.map(|entry| (entry.key.clone(), entry.node.to_toml())).collect()
    }
}

impl Node {
    /// Returns the table, or `None` for any other value.
    pub fn as_table(&self) -> Option<&Table> {
        match &self.value {
            Value::Table(table) => Some(table),
            _ => None,
        }
    }

    /// Returns the string, or `None` for any other value.
    pub fn as_text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Converts the value to a plain TOML value.
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

    /// Returns the type of the value, with its article.
    pub fn kind(&self) -> &'static str {
        match self.value {
            Value::Text(_) => "a string",
            Value::Whole(_) => "an integer",
            Value::Number(_) => "a number",
            Value::Switch(_) => "a boolean",
            Value::Moment(_) => "a date or time",
            Value::List(_) => "an array",
            Value::Table(_) => "a table",
        }
    }
}

/// Parses the text of source number `source`, and adds every syntax error to `problems`.
pub fn parse(text: &str, source: usize, problems: &mut Vec<Problem>) -> Option<Table> {
    if let Some((at, what)) = too_deep(text) {
        let span = Span { source, start: at, end: at + 1 };
        problems.push(Problem::new(span, what).label("here").help("configurations need at most five levels"));
        return None;
    }
    let (root, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return Some(Reader { source, problems }.table(root.get_ref()));
    }
    let errors = errors.iter().map(|error| (error.span().unwrap_or(0..0), error.message()));
    super::grammar::explain(text, source, errors.collect(), problems);
    None
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
            Problem::new(span, "this integer is out of range")
                .label(format!("{} digits", number.len()))
                .help("the maximum is 9223372036854775807"),
        );
        Value::Whole(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brackets::{MAX_DOTS, MAX_NESTED};

    /// Depth of nested tables and arrays.
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
