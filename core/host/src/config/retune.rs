//! Parameter changes of a running behavior, checked like those of its task file.

use yamabico_core::behavior::BehaviorInfo;
use yamabico_parameters::{Problems, Shape, Source, Span, check_table, parse};

/// Merges `changes` into the parameters `table` of the behavior `name`, key by key, and checks the result.
///
/// # Errors
/// All violations of the behavior's schema in the result.
pub fn retune(
    behavior: &BehaviorInfo,
    name: &str,
    table: &toml::Table,
    changes: &toml::Table,
) -> Result<toml::Table, Problems> {
    let mut changed = table.clone();
    merge(&mut changed, changes);
    let text = toml::to_string(&changed).unwrap_or_default();
    let mut problems = Vec::new();
    let schema = &behavior.parameters;
    if let Some(tree) = parse(&text, 0, &mut problems) {
        let top = Span { source: 0, start: 0, end: 0 };
        check_table(&tree, top, &[Shape::new(schema)], &format!("behavior `{name}`"), &mut problems);
    }
    if problems.is_empty() {
        return Ok(changed);
    }
    let mut problems =
        Problems { sources: vec![Source { name: format!("parameters of {name}"), text }], problems };
    problems.sort();
    Err(problems)
}

fn merge(table: &mut toml::Table, changes: &toml::Table) {
    for (key, change) in changes {
        match (table.get_mut(key), change) {
            (Some(toml::Value::Table(table)), toml::Value::Table(changes)) => merge(table, changes),
            _ => drop(table.insert(key.clone(), change.clone())),
        }
    }
}

/// Converts `KEY=VALUE` to a table: a dotted key, and a value that is TOML or a string without quotes.
///
/// # Errors
/// Description of the error.
pub fn assignment(text: &str) -> Result<toml::Table, String> {
    let Some((key, value)) = text.split_once('=') else {
        return Err(format!("`{text}` has no `=`: write KEY=VALUE, such as wall-follower.speed_mps=0.2"));
    };
    let (key, value) = (key.trim(), value.trim());
    let is_one = |table: &toml::Table| table.len() == 1 && !key.contains('\n') && !value.contains('\n');
    let as_written = toml::from_str::<toml::Table>(&format!("{key} = {value}"));
    if let Ok(table) = as_written
        && is_one(&table)
    {
        return Ok(table);
    }
    if value.is_empty() || value.contains('\n') || value.starts_with(['[', '{', '"', '\'']) {
        return Err(format!("`{value}` of `{key}` is not one TOML value"));
    }
    let word = toml::Value::String(value.to_owned());
    toml::from_str::<toml::Table>(&format!("{key} = {word}"))
        .ok()
        .filter(is_one)
        .ok_or_else(|| format!("`{key}` is not a dotted key, such as wall-follower.speed_mps"))
}

/// Converts all `assignments` to one table.
///
/// # Errors
/// One of them is invalid, or two set the same key.
pub fn assignments<'a>(assignments: impl IntoIterator<Item = &'a str>) -> Result<toml::Table, String> {
    let mut all = toml::Table::new();
    for text in assignments {
        let table = assignment(text)?;
        add(&mut all, table).map_err(|key| format!("`{key}` is set twice"))?;
    }
    Ok(all)
}

fn add(all: &mut toml::Table, table: toml::Table) -> Result<(), String> {
    for (key, value) in table {
        match (all.get_mut(&key), value) {
            (None, value) => drop(all.insert(key, value)),
            (Some(toml::Value::Table(all)), toml::Value::Table(more)) => {
                add(all, more).map_err(|inner| format!("{key}.{inner}"))?;
            }
            _ => return Err(key),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_are_values_or_bare_words() {
        let table = assignments(["a-b.speed_mps=0.2", "a-b.side = left", "c.route=[[1.0, 2.0]]"]).unwrap();
        assert_eq!(table["a-b"]["speed_mps"].as_float(), Some(0.2));
        assert_eq!(table["a-b"]["side"].as_str(), Some("left"));
        assert_eq!(table["c"]["route"][0][1].as_float(), Some(2.0));
    }

    #[test]
    fn invalid_assignments_are_refused() {
        for (text, words) in [
            ("a.b", "no `=`"),
            ("a.b=", "not one TOML value"),
            ("a.b=[1", "not one TOML value"),
            ("a b=1", "not a dotted key"),
            ("a.b=1\nc=2", "not one TOML value"),
        ] {
            let error = assignment(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
        assert!(assignments(["a.b=1", "a.b=2"]).unwrap_err().contains("`a.b` is set twice"));
    }

    #[test]
    fn changes_are_merged_key_by_key() {
        let mut table: toml::Table = toml::from_str("a = 1\nt = { x = 1, y = 2 }").unwrap();
        merge(&mut table, &toml::from_str("t = { y = 3 }").unwrap());
        assert_eq!(table, toml::from_str("a = 1\nt = { x = 1, y = 3 }").unwrap());
    }
}
