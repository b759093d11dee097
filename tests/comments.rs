//! What the comments of the configurations say of a key's range is what is checked; where keys of one name have several
//! ranges, one of them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;
use yamabico::plugins::plugins;

/// The ranges that keys of this name have anywhere, in words: `0.1 to 20`.
type Ranges = BTreeMap<String, BTreeSet<String>>;

fn collect(schema: &Value, ranges: &mut Ranges) {
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        for (key, property) in properties {
            // Of a list, the range of its numbers.
            for part in [property, &property["items"]] {
                if let (Some(least), Some(most)) = (part["minimum"].as_f64(), part["maximum"].as_f64()) {
                    ranges.entry(key.clone()).or_default().insert(format!("{least} to {most}"));
                }
            }
        }
    }
    match schema {
        Value::Object(parts) => parts.values().for_each(|part| collect(part, ranges)),
        Value::Array(parts) => parts.iter().for_each(|part| collect(part, ranges)),
        _ => {}
    }
}

/// Keys on this line that hold numbers: `a = 1`, or `a` and `b` in `t = { a = 1, b = 2 }`.
fn number_keys(line: &str) -> Vec<String> {
    fn gather(key: &str, value: &toml::Value, keys: &mut Vec<String>) {
        match value {
            toml::Value::Integer(_) | toml::Value::Float(_) => keys.push(key.to_owned()),
            toml::Value::Array(items) if items.iter().all(|item| item.is_integer() || item.is_float()) => {
                keys.push(key.to_owned());
            }
            toml::Value::Table(table) => table.iter().for_each(|(key, value)| gather(key, value, keys)),
            _ => {}
        }
    }
    let mut keys = Vec::new();
    if let Ok(table) = line.parse::<toml::Table>() {
        table.iter().for_each(|(key, value)| gather(key, value, &mut keys));
    }
    keys
}

fn files_in(folder: &Path, files: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            files_in(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            files.push(path);
        }
    }
}

#[test]
fn every_range_is_told_and_is_the_one_that_is_checked() {
    let mut ranges = Ranges::new();
    collect(&yamabico_host::config::schema(&plugins()), &mut ranges);
    let mut files = Vec::new();
    files_in(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs"), &mut files);
    let (mut told, mut wrong) = (0, Vec::new());
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        // A key is told of where it comes first, in the last comment before it, or else at the head of the file.
        let head: String = text.lines().take_while(|line| line.starts_with('#') || line.is_empty()).collect();
        let (mut known, mut comment, mut in_comment) = (BTreeSet::new(), String::new(), false);
        for line in text.lines() {
            if let Some(words) = line.strip_prefix('#') {
                if !in_comment {
                    comment.clear();
                }
                comment += words;
                in_comment = true;
                continue;
            }
            in_comment = false;
            for key in number_keys(line) {
                let Some(ranges) = ranges.get(&key) else { continue };
                if known.insert(key.clone()) {
                    told += 1;
                    let is_told = |range: &String| comment.contains(range) || head.contains(range);
                    if !ranges.iter().any(is_told) {
                        let file = path.file_name().unwrap().to_string_lossy().into_owned();
                        wrong.push(format!("{file}: {key} is {ranges:?}, the comment says:{comment}"));
                    }
                }
            }
        }
    }
    assert!(told > 50, "{told} keys");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
