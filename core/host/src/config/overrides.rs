//! Changes to a configuration from the command line.

use std::path::PathBuf;

use yamabico_parameters::{Entry, Node, Problem, Span, Table, Value, instead, parse};

/// Changes to a configuration from the command line.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// Robot file that replaces the task file's; relative to the working directory.
    pub robot: Option<PathBuf>,
    /// Assignments `key=value`: a dotted key of the task file, or of the robot file after `robot.`. The value is TOML, or a
    /// string without quotes.
    pub set: Vec<String>,
}

/// Parsed `--set`.
#[derive(Debug)]
pub(crate) struct Change {
    path: Vec<(String, Span)>,
    node: Node,
}

impl Change {
    /// Parses `text`, source number `source`.
    pub fn parse(text: &str, source: usize, problems: &mut Vec<Problem>) -> Option<Change> {
        let whole = Span { source, start: 0, end: text.len() };
        let wrong = |span| {
            Problem::new(span, "`--set` takes KEY=VALUE")
                .help("write, for example, --set behaviors.sonar-halt.gate_m=0.6")
        };
        let Some((key, value)) = text.split_once('=') else {
            problems.push(wrong(whole).label("no `=` after the key"));
            return None;
        };
        let key_span = Span { source, start: 0, end: key.len().max(1) };
        let mut ignored = Vec::new();
        let path = parse(&format!("{key} = 0"), source, &mut ignored).and_then(|table| path_of(&table));
        let Some(path) = path.filter(|_| !key.contains('\n')) else {
            problems.push(wrong(key_span).label("not a dotted key"));
            return None;
        };
        let value_span =
            Span { source, start: text.len() - value.trim_start().len(), end: text.trim_end().len() };
        let mut grammar = Vec::new();
        if let Some(table) = parse(text, source, &mut grammar)
            && let Some(node) = descend(table, &path)
        {
            let is_right = grammar.is_empty();
            problems.append(&mut grammar);
            return is_right.then_some(Change { path, node });
        }
        let value = value.trim();
        if value.is_empty() || value.contains('\n') || value.starts_with(['[', '{', '"', '\'']) {
            let first = grammar.into_iter().next();
            problems.push(first.unwrap_or_else(|| wrong(value_span).label("not one value")));
            return None;
        }
        Some(Change { path, node: Node { span: value_span, value: Value::Text(value.to_owned()) } })
    }

    /// Returns `Ok` with the change to the robot file if it is one, else `Err` with itself.
    pub fn split_robot(mut self) -> Result<Change, Change> {
        if self.path.len() > 1 && self.path[0].0 == "robot" {
            self.path.remove(0);
            return Ok(self);
        }
        Err(self)
    }

    /// Applies the change to `root`.
    pub fn apply(self, root: &mut Table, problems: &mut Vec<Problem>) {
        let Change { path, node } = self;
        let Some(((last, last_span), parents)) = path.split_last() else { return };
        let mut table = root;
        for (depth, (key, key_span)) in parents.iter().enumerate() {
            let named = depth == 1 && matches!(parents[0].0.as_str(), "behaviors" | "sensors" | "devices");
            if table.entry(key).is_none() {
                if named {
                    let names = table.entries.iter().map(|entry| entry.key.as_str());
                    problems.push(
                        Problem::new(*key_span, format!("`{}` has no `{key}` to change", parents[0].0))
                            .label("unknown")
                            .help(instead(key, names, "name")),
                    );
                    return;
                }
                let node = Node { span: *key_span, value: Value::Table(Table::default()) };
                table.entries.push(Entry { key: key.clone(), key_span: *key_span, node });
            }
            let Some(entry) = table.entry_mut(key) else { return };
            let kind = entry.node.kind();
            match &mut entry.node.value {
                Value::Table(inner) => table = inner,
                _ => {
                    problems.push(
                        Problem::new(*key_span, format!("`{key}` is not a table"))
                            .label(format!("is {kind}"))
                            .also(entry.node.span, "set here"),
                    );
                    return;
                }
            }
        }
        match table.entry_mut(last) {
            Some(entry) => (entry.node, entry.key_span) = (node, *last_span),
            None => table.entries.push(Entry { key: last.clone(), key_span: *last_span, node }),
        }
    }
}

/// Returns the dotted key of a table with a single key.
fn path_of(table: &Table) -> Option<Vec<(String, Span)>> {
    let [entry] = table.entries.as_slice() else { return None };
    let mut path = vec![(entry.key.clone(), entry.key_span)];
    if let Some(inner) = entry.node.as_table() {
        path.extend(path_of(inner)?);
    }
    Some(path)
}

/// Returns the value at `path` if the table contains nothing else.
fn descend(mut table: Table, path: &[(String, Span)]) -> Option<Node> {
    let (last, parents) = path.split_last()?;
    for (key, _) in parents {
        let entry = single(table, key)?;
        let Value::Table(inner) = entry.node.value else { return None };
        table = inner;
    }
    Some(single(table, &last.0)?.node)
}

fn single(mut table: Table, key: &str) -> Option<Entry> {
    let entry = table.entries.pop()?;
    (table.entries.is_empty() && entry.key == key).then_some(entry)
}
