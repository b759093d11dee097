//! Valid keys of a table as a Rust type.

use serde_json::Value as Json;

use yamabico_parameters::{Entry, Node, Problem, Shape, Span, Table, Value, check_table};

/// Checks `table` against the keys of `T`, and reads the valid ones.
pub(crate) fn read_keys<T>(table: &Table, header: Span, owner: &str, problems: &mut Vec<Problem>) -> T
where
    T: serde::de::DeserializeOwned + schemars::JsonSchema + Default,
{
    let schema = schemars::schema_for!(T).to_value();
    let mut found = Vec::new();
    check_table(table, header, &[Shape::new(&schema)], owner, &mut found);
    let keys = right_keys(table, header, &found, problems);
    problems.append(&mut found);
    keys
}

/// Reads the keys of `T` without an error in `found`.
pub(crate) fn right_keys<T>(table: &Table, header: Span, found: &[Problem], problems: &mut Vec<Problem>) -> T
where
    T: serde::de::DeserializeOwned + Default,
{
    match prune(table, found).to_toml(|_| true).try_into() {
        Ok(keys) => keys,
        Err(error) => {
            if found.is_empty() {
                problems.push(Problem::new(header, error.message().to_owned()));
            }
            T::default()
        }
    }
}

fn prune(table: &Table, found: &[Problem]) -> Table {
    let wrong = |span: Span| found.iter().any(|problem| problem.span == span);
    let entries = table.entries.iter().filter(|entry| !wrong(entry.key_span) && !wrong(entry.node.span));
    let entries = entries.map(|entry| Entry { node: prune_node(&entry.node, found), ..entry.clone() });
    Table { entries: entries.collect() }
}

fn prune_node(node: &Node, found: &[Problem]) -> Node {
    let wrong = |item: &&Node| !found.iter().any(|problem| problem.span == item.span);
    let value = match &node.value {
        Value::Table(table) => Value::Table(prune(table, found)),
        Value::List(items) => {
            Value::List(items.iter().filter(wrong).map(|item| prune_node(item, found)).collect())
        }
        other => other.clone(),
    };
    Node { span: node.span, value }
}

/// Returns the keys of a table that are missing from the schema `common` or present in `own`.
pub(crate) fn own_keys(table: &Table, common: &Json, own: &Json) -> toml::Table {
    let has = |schema: &Json, key: &str| Shape::new(schema).properties().iter().any(|(name, _)| *name == key);
    table.to_toml(|key| has(own, key) || !has(common, key))
}

/// Checks that a name fits into messages and service names.
pub(crate) fn check_name(name: &str, span: Span, problems: &mut Vec<Problem>) {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > 32 || !name.chars().all(allowed) {
        problems.push(
            Problem::new(span, format!("`{}` is not a valid name", name.escape_debug()))
                .label("must have 1 to 32 letters, digits, `-` or `_`")
                .help("for example front-sonar"),
        );
    }
}
