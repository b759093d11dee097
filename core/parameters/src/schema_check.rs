//! Check of a table against JSON Schemas: all unknown keys, missing keys, wrong types and values out of range at once.

use std::collections::BTreeSet;

use serde_json::Value as Json;

use super::document::{Node, Table, Value};
use super::nearest::{instead, nearest, quoted};
use super::problem::{Problem, Span};
use super::shape::Shape;
use super::units::{meant, number, unit_of};

/// Schema keyword of a parameter that was renamed: the name that is no longer accepted, for which the error suggests the
/// parameter.
const FORMER_NAME: &str = "former_name";

/// Checks every key of `table` against the union of `shapes`. `owner` names the table in errors; missing keys are
/// reported at `header`.
pub fn check_table(
    table: &Table,
    header: Span,
    shapes: &[Shape<'_>],
    owner: &str,
    problems: &mut Vec<Problem>,
) {
    let shapes: Vec<Shape<'_>> = shapes.iter().map(|shape| shape.resolved()).collect();
    let known: Vec<(&str, Shape<'_>)> = shapes.iter().flat_map(|shape| shape.properties()).collect();
    let mut suggested = BTreeSet::new();
    for entry in &table.entries {
        let property = known.iter().find(|(key, _)| *key == entry.key).map(|(_, shape)| *shape);
        let free = || shapes.iter().find_map(|shape| shape.free_keys());
        match property.or_else(free) {
            Some(shape) => check_value(&entry.key, &entry.node, shape, owner, problems),
            None => {
                let absent = known.iter().filter(|(key, _)| table.entry(key).is_none());
                let renamed = absent.clone().find(|(_, shape)| shape.text(FORMER_NAME) == Some(&entry.key));
                let similar = || nearest(&entry.key, absent.map(|(key, _)| *key));
                let help = match renamed.map(|(key, _)| *key).or_else(similar) {
                    Some(key) => {
                        suggested.insert(key);
                        format!("did you mean `{key}`?")
                    }
                    None => instead(&entry.key, known.iter().map(|(key, _)| *key), "key"),
                };
                problems.push(
                    Problem::new(entry.key_span, format!("unknown key `{}`", entry.key))
                        .label(format!("{owner} has no such key"))
                        .help(help),
                );
            }
        }
    }
    for shape in &shapes {
        for key in shape.required() {
            if table.entry(key).is_none() && !suggested.contains(key) {
                let property = known.iter().find(|(name, _)| *name == key).map(|(_, shape)| *shape);
                problems.push(
                    Problem::new(header, format!("`{key}` is missing"))
                        .label(format!("required by {owner}"))
                        .help(
                            property.map_or(format!("add {key} = ..."), |shape| example(key, shape, header)),
                        ),
                );
            }
        }
    }
}

/// Returns an example of a missing key.
fn example(key: &str, shape: Shape<'_>, header: Span) -> String {
    let about = shape.text("description").or(shape.resolved().text("description"));
    let about = about.map_or(String::new(), |text| format!("  # {}", first_sentence(text)));
    let shape = shape.resolved();
    let words = shape.words();
    let is_top = header.start == header.end;
    if is_top && shape.types() == ["object"] {
        let free = shape.properties().is_empty() && shape.free_keys().is_some();
        let every = if free { ".NAME" } else { "" };
        return format!("add a table [{key}{every}]{about}");
    }
    let value = match (words.first(), shape.types().first()) {
        (Some(word), _) => format!("\"{word}\""),
        (None, Some(&"string")) => "\"...\"".to_owned(),
        (None, Some(&"boolean")) => "true".to_owned(),
        (None, Some(&"array")) => "[...]".to_owned(),
        (None, Some(&"object")) => "{ ... }".to_owned(),
        _ => example_value(shape).unwrap_or_else(|| "...".to_owned()),
    };
    format!("add {key} = {value}{about}")
}

fn first_sentence(text: &str) -> String {
    let text = text.replace('\n', " ");
    text.split_once(". ").map_or(text.as_str(), |(first, _)| first).trim_end_matches('.').to_owned()
}

fn check_value(key: &str, node: &Node, shape: Shape<'_>, owner: &str, problems: &mut Vec<Problem>) {
    let shape = shape.resolved();
    let words = shape.words();
    if !words.is_empty() && shape.alternatives().iter().all(|branch| !branch.resolved().words().is_empty()) {
        return check_word(key, node, &words, problems);
    }
    let branches = shape.alternatives();
    if !branches.is_empty() {
        return check_branches(key, node, &branches, owner, problems);
    }
    let types = shape.types();
    let fits = |name: &&str| match &node.value {
        Value::Text(_) => *name == "string",
        Value::Whole(_) => matches!(*name, "integer" | "number"),
        Value::Number(number) => *name == "number" || (*name == "integer" && number.fract() == 0.0),
        Value::Switch(_) => *name == "boolean",
        Value::Moment(_) => false,
        Value::List(_) => *name == "array",
        Value::Table(_) => *name == "object",
    };
    if !types.is_empty() && !types.iter().any(fits) {
        problems.push(wrong_type(key, node, &types, shape));
        return;
    }
    match &node.value {
        Value::Whole(number) => check_range(key, node, *number as f64, shape, problems),
        Value::Number(number) if types.as_slice() == ["integer"] => {
            problems.push(
                Problem::new(node.span, format!("`{key}` must be an integer"))
                    .label("has a decimal point")
                    .help(format!("write {key} = {}", super::units::number(*number))),
            );
        }
        Value::Number(number) => check_range(key, node, *number, shape, problems),
        Value::List(items) => check_items(key, node, items, shape, owner, problems),
        Value::Table(table) if shape.part.get("properties").is_some() || shape.free_keys().is_some() => {
            check_table(table, node.span, &[shape], &format!("`{key}`"), problems);
        }
        _ => {}
    }
}

fn check_word(key: &str, node: &Node, words: &[&str], problems: &mut Vec<Problem>) {
    match node.as_text() {
        Some(word) if words.contains(&word) => {}
        Some(word) => problems.push(
            Problem::new(node.span, format!("`{key}` must not be \"{word}\""))
                .label("not an allowed value")
                .help(instead(word, words.iter().copied(), "value")),
        ),
        None => problems.push(
            Problem::new(node.span, format!("`{key}` must be one of {}", quoted(words)))
                .label(format!("expected a string, found {}", node.kind()))
                .help(format!("write {key} = \"{}\"", words.first().unwrap_or(&""))),
        ),
    }
}

/// Checks against the intended branch: the one with the same constant key, else the one with the fewest errors.
fn check_branches(key: &str, node: &Node, branches: &[Shape<'_>], owner: &str, problems: &mut Vec<Problem>) {
    if let Some(table) = node.as_table()
        && let Some((tag, words)) = shared_tag(branches)
    {
        let header = node.span;
        let Some(entry) = table.entry(tag) else {
            let help = format!("add {tag} = one of {}", quoted(&words));
            problems.push(
                Problem::new(header, format!("`{tag}` is missing"))
                    .label(format!("required by `{key}`"))
                    .help(help),
            );
            return;
        };
        let word = entry.node.as_text();
        let branch = branches.iter().find(|branch| {
            let properties = branch.resolved().properties();
            properties.iter().any(|(key, shape)| *key == tag && shape.words().first().copied() == word)
        });
        match branch {
            Some(branch) => check_table(table, header, &[*branch], &format!("`{key}`"), problems),
            None => check_word(tag, &entry.node, &words, problems),
        }
        return;
    }
    let attempts = branches.iter().map(|branch| {
        let mut found = Vec::new();
        check_value(key, node, *branch, owner, &mut found);
        found
    });
    if let Some(best) = attempts.min_by_key(Vec::len) {
        problems.extend(best);
    }
}

/// Returns the key that has a different constant in each branch, and the constants.
fn shared_tag<'a>(branches: &[Shape<'a>]) -> Option<(&'a str, Vec<&'a str>)> {
    let first = branches.first()?.resolved().properties();
    first.iter().find_map(|(key, _)| {
        let word = |branch: &Shape<'a>| {
            let properties = branch.resolved().properties();
            let shape = properties.iter().find(|(name, _)| name == key)?.1;
            shape.part.get("const").and_then(Json::as_str)
        };
        let words: Option<Vec<&str>> = branches.iter().map(word).collect();
        Some((*key, words?))
    })
}

fn wrong_type(key: &str, node: &Node, types: &[&str], shape: Shape<'_>) -> Problem {
    let name = |name: &&str| match *name {
        "string" => "a string",
        "integer" => "an integer",
        "number" => "a number",
        "boolean" => "a boolean",
        "array" => "an array",
        _ => "a table",
    };
    let expected: Vec<&str> = types.iter().map(name).collect();
    let expected = expected.join(" or ");
    let wants = |name: &str| types.contains(&name);
    let has_decimals = matches!(node.value, Value::Number(_)) && wants("integer");
    let found = if has_decimals { "a number with decimals" } else { node.kind() };
    let problem = Problem::new(node.span, format!("`{key}` must be {expected}"))
        .label(format!("expected {expected}, found {found}"));
    match &node.value {
        Value::Text(text) if wants("number") && text.trim().parse::<f64>().is_ok() => {
            problem.help(format!("remove the quotes: {key} = {}", text.trim()))
        }
        Value::Text(text) if wants("boolean") => {
            let on = matches!(text.to_lowercase().as_str(), "true" | "yes" | "on" | "1");
            problem.help(format!("remove the quotes: {key} = {on}"))
        }
        Value::Whole(_) | Value::Number(_) | Value::Switch(_) if wants("string") => {
            problem.help(format!("add quotes: {key} = \"{}\"", node.to_toml()))
        }
        Value::Number(number) if wants("integer") => {
            problem.help(format!("write {key} = {}", super::units::number(number.round())))
        }
        _ if wants("array") && !matches!(node.value, Value::Table(_)) => {
            problem.help(format!("write {key} = [{}]", node.to_toml()))
        }
        _ => {
            let unit = unit_of(key).map_or(String::new(), |unit| format!("  # {unit}"));
            match example_value(shape) {
                Some(value) => problem.help(format!("write, for example, {key} = {value}{unit}")),
                None => problem,
            }
        }
    }
}

/// Returns a valid value as TOML: the default, the first of the schema's examples, or a number in range.
fn example_value(shape: Shape<'_>) -> Option<String> {
    let default = shape.part.get("default").filter(|value| !value.is_null() && !value.is_object());
    if let Some(value) = default.or_else(|| shape.part.get("examples")?.get(0)) {
        return Some(value.to_string());
    }
    let (low, high) = (shape.bound("minimum"), shape.bound("maximum"));
    let in_range = || 1.0_f64.max(low.unwrap_or(f64::MIN)).min(high.unwrap_or(f64::MAX));
    match shape.types().first() {
        Some(&"integer") => Some(super::units::number(in_range())),
        Some(&"number") => Some(format!("{:?}", in_range())),
        _ => None,
    }
}

fn check_range(key: &str, node: &Node, value: f64, shape: Shape<'_>, problems: &mut Vec<Problem>) {
    if !value.is_finite() {
        problems
            .push(Problem::new(node.span, format!("`{key}` must be a finite number")).label("not finite"));
        return;
    }
    let lowest = shape.bound("minimum");
    let above = shape.bound("exclusiveMinimum");
    let highest = shape.bound("maximum");
    let below = shape.bound("exclusiveMaximum");
    let fits = |value: f64| {
        lowest.is_none_or(|bound| value >= bound)
            && above.is_none_or(|bound| value > bound)
            && highest.is_none_or(|bound| value <= bound)
            && below.is_none_or(|bound| value < bound)
    };
    if fits(value) {
        return;
    }
    let too_small = lowest.is_some_and(|bound| value < bound) || above.is_some_and(|bound| value <= bound);
    let unit = unit_of(key).map_or(String::new(), |unit| format!(" {unit}"));
    let label = match (too_small, lowest, above, highest, below) {
        (true, Some(bound), ..) => format!("must be at least {}{unit}", number(bound)),
        (true, None, Some(bound), ..) => format!("must be more than {}{unit}", number(bound)),
        (_, _, _, Some(bound), _) => format!("must be at most {}{unit}", number(bound)),
        (.., Some(bound)) => format!("must be less than {}{unit}", number(bound)),
        _ => "out of range".to_owned(),
    };
    let size = if too_small { "too small" } else { "too large" };
    let mut problem =
        Problem::new(node.span, format!("`{key}` = {}{unit} is {size}", number(value))).label(label);
    let default = shape.bound("default").map(|value| format!("the default is {}{unit}", number(value)));
    problem.help = meant(key, value, fits).or(default);
    problems.push(problem);
}

fn check_items(
    key: &str,
    node: &Node,
    items: &[Node],
    shape: Shape<'_>,
    owner: &str,
    problems: &mut Vec<Problem>,
) {
    let count = |name: &str| shape.part.get(name).and_then(Json::as_u64).map(|count| count as usize);
    let (min, max) = (count("minItems").unwrap_or(0), count("maxItems").unwrap_or(usize::MAX));
    if items.len() < min || items.len() > max {
        let wanted = match (min, max) {
            (min, max) if min == max => format!("{min}"),
            (min, usize::MAX) => format!("at least {min}"),
            (0, max) => format!("at most {max}"),
            (min, max) => format!("{min} to {max}"),
        };
        problems.push(
            Problem::new(node.span, format!("`{key}` must have {wanted} items"))
                .label(format!("has {}", items.len())),
        );
    }
    let tuple = shape.part.get("prefixItems").and_then(Json::as_array);
    let every = shape.part.get("items").filter(|part| part.is_object());
    let is_nested = every.is_some_and(|part| shape.at(part).types() == ["array"]);
    if is_nested && !items.is_empty() && items.iter().all(|item| !matches!(item.value, Value::List(_))) {
        problems.push(
            Problem::new(node.span, format!("`{key}` must be an array of arrays"))
                .label(format!(
                    "is an array of {}s",
                    items[0].kind().trim_start_matches("an ").trim_start_matches("a ")
                ))
                .help(format!("write {key} = [{}]", node.to_toml())),
        );
        return;
    }
    for (index, item) in items.iter().enumerate() {
        if let Some(part) = tuple.and_then(|parts| parts.get(index)).or(every) {
            let before = problems.len();
            check_value(key, item, shape.at(part), owner, problems);
            for problem in problems[before..].iter_mut().filter(|problem| problem.span == item.span) {
                let (name, item) = (format!("`{key}`"), format!("item {} of `{key}`", index + 1));
                problem.message = problem.message.replacen(&name, &item, 1);
                problem.help = problem.help.take().map(|help| help.replace(&format!("{key} = "), ""));
            }
        }
    }
}
