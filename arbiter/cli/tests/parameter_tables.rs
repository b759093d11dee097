//! The parameter tables in the READMEs of behaviors and sensors are generated from the schemas.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use yamabico::plugins::plugins;
use yamabico_host::config::{Parameter, describe};

const UPDATE: &str = "YAMABICO_UPDATE";
const COMMAND: &str = "YAMABICO_UPDATE=1 cargo test -p yamabico --test integration parameter_tables";

/// READMEs of the crates in a folder of the repository.
fn readmes(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder);
    let crates = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path().join("README.md"));
    let mut readmes: Vec<PathBuf> = crates.filter(|path| path.is_file()).collect();
    readmes.sort();
    readmes
}

/// Table of the parameters of a plugin.
fn table(name: &str) -> String {
    let mut text = String::from("| Parameter | Unit | Range | Default | Meaning |\n|---|---|---|---|---|\n");
    for parameter in describe(name, &plugins()).unwrap().parameters {
        // The keys of a table have their own rows.
        if parameter.takes == "table" {
            continue;
        }
        let Parameter { key, unit, summary, .. } = &parameter;
        let (range, default) = (range(&parameter), default(&parameter));
        let unit = unit.unwrap_or("");
        writeln!(text, "| `{key}` | {unit} | {range} | {default} | {} |", summary.replace('|', "\\|"))
            .unwrap();
    }
    text
}

fn range(parameter: &Parameter) -> String {
    if let Some(range) = &parameter.range {
        return range.clone();
    }
    let words: Vec<&str> = parameter.takes.split(" | ").filter_map(|word| word.strip_prefix('"')).collect();
    words.iter().map(|word| format!("`{}`", word.trim_end_matches('"'))).collect::<Vec<_>>().join(", ")
}

fn default(parameter: &Parameter) -> String {
    match &parameter.default {
        _ if parameter.required => "required".to_owned(),
        None => String::new(),
        Some(serde_json::Value::String(word)) => format!("`{word}`"),
        Some(serde_json::Value::Number(number)) => {
            number.as_f64().map_or_else(|| number.to_string(), yamabico_parameters::number)
        }
        Some(other) => other.to_string(),
    }
}

/// The README with every table between `<!-- parameters: NAME -->` and `<!-- /parameters -->` generated. Without a name,
/// the table is that of the behavior in this folder.
fn generated(path: &Path, text: &str) -> String {
    let folder = path.parent().unwrap().file_name().unwrap().to_string_lossy().replace('_', "-");
    let mut parts = text.split("<!-- parameters");
    let mut result = parts.next().unwrap().to_owned();
    for part in parts {
        let (name, rest) = part.split_once("-->").expect("the marker is closed");
        let (_, rest) = rest.split_once("<!-- /parameters -->").expect("<!-- /parameters --> follows");
        let plugin = name.trim().strip_prefix(':').map_or(folder.as_str(), str::trim);
        write!(result, "<!-- parameters{name}-->\n{}<!-- /parameters -->{rest}", table(plugin)).unwrap();
    }
    result
}

#[test]
fn readmes_show_the_parameters_of_the_schemas() {
    let mut outdated = Vec::new();
    for (path, is_behavior) in readmes("behaviors")
        .into_iter()
        .map(|p| (p, true))
        .chain(readmes("sensors").into_iter().map(|p| (p, false)))
    {
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.contains("<!-- parameters") || !is_behavior,
            "{} has no parameter table",
            path.display()
        );
        let generated = generated(&path, &text);
        if generated != text && std::env::var_os(UPDATE).is_some() {
            std::fs::write(&path, generated).unwrap();
        } else if generated != text {
            outdated.push(path.display().to_string());
        }
    }
    assert!(outdated.is_empty(), "outdated: {}\nto update: {COMMAND}", outdated.join(", "));
}
